import pytest

from fleet.host.requests.event_reporter import EventReporter
from fleet.host.requests.unrequested_events import UnrequestedEvents
from fleet.model.event import EventKind
from fleet.model.health import Health, Level
from fleet.model.report import FlightControllerReport, StatusText
from fleet.testing.clock import ManualClock


@pytest.fixture
def events():
    return []


@pytest.fixture
def unrequested_events(events):
    return UnrequestedEvents(EventReporter("rex", events.append, ManualClock(), in_motion=lambda: False))


def test_a_robot_is_found_changes_its_health_is_lost_and_is_found_again(unrequested_events, events):
    for level, cause in (
        (Level.OK, ""),
        (Level.DEGRADED, "its battery is low"),
        (Level.OFFLINE, "unplugged"),
        (Level.FAULT, "a leg is loose"),
        (Level.OK, ""),
        (Level.FAULT, "a leg is loose"),
        (Level.OK, ""),
    ):
        unrequested_events.report_level(Health(level, cause))
    assert [(event.kind.value, event.text, event.severity.value) for event in events] == [
        ("found", "ok", "info"),
        ("health", "degraded: its battery is low", "warning"),
        ("lost", "offline: unplugged", "warning"),
        ("health", "fault: a leg is loose", "error"),
        ("found", "ok", "info"),
        ("health", "fault: a leg is loose", "error"),
        ("health", "ok", "info"),
    ]
    assert events[2].data == {"level": "offline", "cause": "unplugged"}


def test_a_fail_safe_is_reported_when_it_begins_with_the_autopilots_own_words(unrequested_events, events):
    texts = (StatusText("Radio Failsafe", 4),)
    for failsafe in (False, True, True, False, True):
        unrequested_events.observe(FlightControllerReport(1.0, True, "RTL", failsafe, status_texts=texts))
    assert [event.kind for event in events] == [EventKind.FAILSAFE] * 2
    assert events[0].text == "the autopilot's fail-safe is active, mode RTL: Radio Failsafe"
    assert events[0].data == {"mode": "RTL", "status_texts": ["Radio Failsafe"]}
