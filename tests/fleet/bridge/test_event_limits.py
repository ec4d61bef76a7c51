"""What the cloud is told of a robot's events has bounds, and a loop through the cloud is cut."""

import pytest

from fleet.bridge.event_limits import A_MINUTE, DEFAULT_A_MINUTE, LOOP, EventLimits
from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester
from fleet.wire.events import CLOUD_EVENTS

TOPIC, OTHER = "cyberwave/twin/a/event", "cyberwave/twin/b/event"
CLOUD, LOCAL = Requester(Transport.CLOUD, "wf-1", "edge"), Requester(Transport.BUS, "anna")


def event(kind=EventKind.SEPARATION, asker=None, request=""):
    return EventReport(0.0, kind, "x", asker=asker, request=request)


@pytest.mark.parametrize("kind", sorted(CLOUD_EVENTS))
def test_of_each_kind_a_robot_tells_so_many_a_minute_and_each_robot_and_kind_has_its_own(kind):
    limits, most = EventLimits(), A_MINUTE.get(kind, DEFAULT_A_MINUTE)
    assert [limits.admits(TOPIC, event(kind), 0.1 * n, 0.0) for n in range(most + 2)] == [True] * most + [
        False
    ] * 2
    other = next(each for each in CLOUD_EVENTS if each is not kind)
    assert limits.admits(OTHER, event(kind), 2.0, 0.0)
    assert limits.admits(TOPIC, event(other), 2.0, 0.0)
    assert limits.admits(TOPIC, event(kind), 60.0, 0.0)


def test_what_was_cut_is_reported_a_minute_later_with_its_number_and_reason():
    limits = EventLimits()
    for n in range(DEFAULT_A_MINUTE + 3):
        limits.admits(TOPIC, event(), float(n), 1000.0 + n)
    assert limits.take_suppressed(65.0) == []
    (cut,) = limits.take_suppressed(66.0)
    assert (cut.topic, cut.reason.value, cut.lost, cut.since, cut.until) == (TOPIC, "rate", 3, 1006.0, 1008.0)
    assert limits.take_suppressed(200.0) == []


def test_a_loop_through_the_cloud_is_cut_until_it_has_been_quiet_for_a_minute():
    limits = EventLimits()
    admitted = [limits.admits(TOPIC, event(asker=CLOUD, request=f"r{n}"), 5.0 * n, 0.0) for n in range(30)]
    assert admitted == [True] * LOOP + [False] * (30 - LOOP)
    assert limits.admits(TOPIC, event(asker=CLOUD, request="late"), 5.0 * 29 + 60.0, 0.0)
    (cut,) = limits.take_suppressed(500.0)
    assert (cut.reason.value, cut.lost) == ("loop", 30 - LOOP)


def test_many_events_of_one_request_and_those_of_people_on_the_spot_are_no_loop():
    limits = EventLimits()
    assert all(
        limits.admits(TOPIC, event(asker=CLOUD, request="one"), float(n), 0.0)
        for n in range(DEFAULT_A_MINUTE)
    )
    limits = EventLimits()
    assert all(
        limits.admits(TOPIC, event(asker=LOCAL, request=str(n)), float(n), 0.0)
        for n in range(DEFAULT_A_MINUTE)
    )


def test_a_flood_in_the_fleets_name_on_the_bus_takes_no_room_from_our_own_events():
    limits = EventLimits()
    heard = [limits.admits(TOPIC, event(), 0.0, 0.0, heard=True) for _ in range(DEFAULT_A_MINUTE + 5)]
    assert heard == [True] * DEFAULT_A_MINUTE + [False] * 5
    assert [limits.admits(TOPIC, event(), 1.0, 0.0) for _ in range(DEFAULT_A_MINUTE)] == [
        True
    ] * DEFAULT_A_MINUTE
