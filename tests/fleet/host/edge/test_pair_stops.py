"""Stops of a pair at one of its edges: what it does for the holder's list; tests/system shows both edges."""

import threading
from types import SimpleNamespace

import msgspec
import pytest

from fleet.bus import keys
from fleet.host.edge.pair_stops import NOT_KNOWN, PairStops
from fleet.host.runtime.threads import NAME
from fleet.host.safety.emergency_stop import EmergencyStopLatch
from fleet.standby.lease import LeaseEntry
from fleet.standby.stops import AGAIN_AFTER
from fleet.testing.clock import ManualClock
from tests.tools.waiting import DEADLINE, wait_until


class Robot:
    """A robot that does not run here, with its latch."""

    def __init__(self):
        self.controller = self
        self.latch = EmergencyStopLatch()

    @property
    def latched(self):
        return self.latch.set


class Session:
    """A session whose link is full until it is freed, or that fails."""

    def __init__(self):
        self.put_on = []
        self.freed = threading.Event()
        self.fails = False

    def put(self, key, payload, *, urgent):
        if self.fails:
            raise RuntimeError("the session is closed")
        self.freed.wait(DEADLINE)
        self.put_on.append((key, msgspec.json.decode(payload), urgent, threading.current_thread().name))


@pytest.fixture
def edge():
    """Make the standby edge of a pair, whose link to the holder is full."""
    made = SimpleNamespace(robots={"rex": Robot(), "max": Robot()}, session=Session(), clock=ManualClock())
    made.stops = PairStops("yard-a", made.robots, made.session, made.clock)
    yield made
    made.session.freed.set()


def listed(**stops):
    """Return the holder's entry."""
    return LeaseEntry("yard-a", "1", 1, stops=stops)


def test_a_stop_is_passed_on_beside_the_loop_which_a_full_link_does_not_hold_up(edge):
    edge.robots["rex"].latch.engage("asked by anna")
    edge.stops.follow(listed(max="fire"))  # with the link full
    assert edge.robots["max"].latched
    assert edge.session.put_on == []
    edge.session.freed.set()
    wait_until("it is passed on", lambda: edge.session.put_on)
    assert edge.session.put_on == [(keys.stop("yard-a"), ["rex"], True, NAME)]


def test_a_stop_that_could_not_be_passed_on_is_passed_on_again_until_the_holder_has_it(edge, caplog):
    edge.session.freed.set()
    edge.robots["rex"].latch.engage("asked by anna")
    edge.session.fails = True
    edge.stops.follow(listed())
    wait_until("the failure is told", lambda: "tried again" in caplog.text)
    edge.session.fails = False
    edge.clock.advance(AGAIN_AFTER)
    edge.stops.follow(listed())
    wait_until("it is passed on", lambda: edge.session.put_on)
    edge.clock.advance(AGAIN_AFTER)
    edge.stops.follow(listed(rex="asked by anna"))
    edge.clock.advance(AGAIN_AFTER)
    edge.stops.follow(listed(rex="asked by anna"))
    assert len(edge.session.put_on) == 1


def test_the_stops_are_listed_though_a_robot_joins_meanwhile(edge):
    class Joins(Robot):
        @property
        def latched(self):
            edge.robots["new"] = Robot()
            return True

    edge.robots["rex"] = Joins()
    assert edge.stops.listed == {"rex": ""}


def test_without_an_entry_every_robot_is_stopped(edge):
    edge.stops.take_over(None)
    assert edge.stops.listed == {"rex": NOT_KNOWN, "max": NOT_KNOWN}


def test_a_release_at_the_holder_is_followed(edge):
    edge.stops.follow(listed(rex="fire"))
    assert edge.stops.listed == {"rex": "set at edge yard-a: fire"}
    edge.stops.follow(listed())
    assert edge.stops.listed == {}
