import json

import pytest

from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.wire.databus import decode_report, encode_report
from fleet.wire.events import CLOUD_EVENTS, is_fleet_event
from fleet.wire.reports import sender, to_mqtt
from fleet.wire.samples import json_payload

BREACH = EventReport(
    5.0,
    EventKind.FENCE,
    "it is outside the fence",
    Severity.WARNING,
    Requester(Transport.CLOUD, "python-sdk_live_1", "tele"),
    "goto",
    "r1",
    {"reason": "outside the fence"},
)


def published(report):
    """Return the messages of a report by suffix, as a JSON reader sees them."""
    messages = to_mqtt(report, sender(source_type="edge", session="us"))
    return {suffix: json.loads(payload) for suffix, payload in messages}


def test_the_cloud_reads_an_event_in_the_form_of_the_sdk_with_what_led_to_it():
    assert published(BREACH) == {
        "event": {
            "event_type": "fence_breached",
            "source": "fleet",
            "data": {
                "reason": "outside the fence",
                "text": "it is outside the fence",
                "severity": "warning",
                "command": "goto",
                "request": "r1",
                "asker": {"way": "cloud", "name": "python-sdk_live_1", "source_type": "tele"},
            },
            "timestamp": 5.0,
            "session_id": "us",
            "source_type": "edge",
        }
    }


def test_an_event_that_nobody_asked_for_names_nobody():
    (message,) = published(EventReport(1.0, EventKind.LOST, "the link fell")).values()
    assert message["data"] == {"text": "the link fell", "severity": "info"}


@pytest.mark.parametrize("kind", EventKind)
def test_what_was_asked_and_how_it_ended_is_not_reported_to_the_cloud_as_an_event(kind):
    requested = {EventKind.COMMAND, EventKind.OUTCOME, EventKind.STOP, EventKind.RELEASE, EventKind.SCHEDULE}
    assert bool(published(EventReport(1.0, kind, "x"))) == (kind not in requested) == (kind in CLOUD_EVENTS)


def test_an_event_on_the_bus_has_the_names_of_its_topic_and_comes_back_whole():
    sample = encode_report(BREACH, 1)
    document = json.loads(json_payload(sample))
    assert (document["event_type"], document["source"], document["ts"]) == ("fence_breached", "fleet", 5.0)
    assert decode_report("event", sample) == BREACH


@pytest.mark.parametrize(
    ("sample", "channel", "ours"),
    [
        (encode_report(BREACH, 1), "event", True),
        (encode_report(BREACH, 1), "map_update", False),
        (b'{"event_type": "fall", "source": "edge_node"}', "event", False),
        (b'{"event_type": "fall"}', "event", False),
        (b'{"source": ["fleet"]}', "event", False),
        (b"[1]", "event", False),
        (b"", "event", False),
    ],
)
def test_the_fleets_own_events_are_distinguished_from_those_of_other_programs(sample, channel, ours):
    assert is_fleet_event(sample, channel) is ours
