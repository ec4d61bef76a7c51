"""What real autopilots said, replayed: every vehicle is found, nothing else is taken for one.

The recordings hold both directions, as ArduCopter and ArduRover 4.6.3 and PX4 1.16.1 spoke; the fast
streams are thinned out.
"""

import contextlib
import itertools

import pytest

from fleet.testing.clock import ManualClock
from fleet_mavlink.link_hub import LinkHub
from fleet_mavlink.messages import CommandAck

PX4_TRIALS = (
    "AUTO.LOITER AUTO.TAKEOFF AUTO.LOITER AUTO.LAND AUTO.LOITER AUTO.TAKEOFF AUTO.LOITER AUTO.LAND "
    "AUTO.LOITER AUTO.TAKEOFF AUTO.LOITER ORBIT AUTO.LOITER AUTO.LAND AUTO.TAKEOFF AUTO.LOITER "
    "AUTO.LAND AUTO.LOITER POSCTL MANUAL OFFBOARD AUTO.LAND AUTO.RTL"
)
PX4_VTOL = "AUTO.LOITER AUTO.TAKEOFF AUTO.LOITER OFFBOARD AUTO.LOITER AUTO.RTL AUTO.LAND AUTO.LOITER"
FLIGHTS = {
    # recording: {system: (flavour, modes in order)}
    "ap_copter_full_flight": {
        1: ("ardupilot", "STABILIZE GUIDED RTL STABILIZE GUIDED STABILIZE GUIDED RTL"),
    },
    "ap_two_copters_gimbal_adsb_one_link": {
        1: ("ardupilot", "STABILIZE GUIDED LAND"),
        2: ("ardupilot", "STABILIZE GUIDED LAND"),
    },
    "ap_via_mavproxy_gcs_heartbeats": {3: ("ardupilot", "STABILIZE")},
    "ap_copter_signed_link2": {1: ("ardupilot", "GUIDED")},
    "px4_full_flight": {
        1: (
            "px4",
            "AUTO.LOITER AUTO.TAKEOFF AUTO.LOITER AUTO.TAKEOFF AUTO.LOITER AUTO.RTL AUTO.LOITER",
        ),
    },
    "px4_two_vehicles_one_port": {
        1: ("px4", "AUTO.LOITER AUTO.TAKEOFF AUTO.LOITER AUTO.LAND AUTO.LOITER"),
        2: ("px4", "AUTO.LOITER AUTO.TAKEOFF AUTO.LAND AUTO.TAKEOFF"),
    },
    "px4_takeoff_variants": {
        1: (
            "px4",
            PX4_TRIALS,
        ),
    },
    "ap_rover_stops": {
        1: (
            "ardupilot",
            "INITIALISING MANUAL GUIDED LOITER GUIDED HOLD GUIDED AUTO HOLD AUTO HOLD",
        ),
    },
    "px4_vtol": {1: ("px4", PX4_VTOL)},
    "px4_plane_land": {
        1: ("px4", "AUTO.LOITER AUTO.TAKEOFF AUTO.LOITER AUTO.LAND AUTO.LOITER AUTO.LAND AUTO.LOITER"),
    },
}
WHOLE = {"datagrams": 0, "bytes": 1, "odd pieces": 7}
recordings = pytest.mark.parametrize("name", FLIGHTS)


class Silent:
    """A link on which nothing is written."""

    url = "replay"


class Replay:
    """A hub that hears a recording, as the station that made it, and every vehicle in it."""

    def __init__(self, systems, component=190):
        self.clock = ManualClock(monotonic=0.0)
        self.hub = LinkHub(Silent(), self.clock, 255, component)
        self._claims = contextlib.ExitStack()
        self.vehicles = {system: self._claims.enter_context(self.hub.vehicle(system)) for system in systems}
        self.modes = {system: [] for system in systems}
        self.armed = {system: [] for system in systems}
        self.acks = {system: [] for system in systems}
        self.texts = {system: [] for system in systems}
        for system, vehicle in self.vehicles.items():
            vehicle.on_heartbeat = lambda system=system: self._beat(system)
            vehicle.on_ack = self.acks[system].append
            vehicle.on_sentence = lambda said, system=system: self.texts[system].append(said.text)

    def _beat(self, system):
        vehicle = self.vehicles[system]
        self.modes[system].append(vehicle.kind.mode_of(vehicle.state))
        self.armed[system].append(vehicle.state.armed)

    def play(self, records, cut=0):
        for stamp, frame in records:
            self.clock.advance(max(0.0, stamp - self.clock.monotonic()))
            pieces = [frame] if not cut else [frame[at : at + cut] for at in range(0, len(frame), cut)]
            for piece in pieces:
                self.hub.receive(piece, None)
        return self


def changes(values):
    """Return values without their repetitions."""
    return [value for value, _ in itertools.groupby(values)]


@recordings
@pytest.mark.parametrize("cut", WHOLE.values(), ids=WHOLE)
def test_every_vehicle_is_found_with_its_modes_and_no_other(recording, name, cut):
    expected = FLIGHTS[name]
    replay = Replay(expected).play(recording(name), cut)
    assert replay.hub.heard == tuple(expected)
    for system, (flavour, modes) in expected.items():
        assert replay.vehicles[system].kind.name == flavour
        assert changes(replay.modes[system]) == modes.split()
        assert replay.vehicles[system].state.reboots == 0


@pytest.mark.parametrize(
    ("name", "flights"),
    [("ap_copter_full_flight", 1), ("px4_full_flight", 2), ("px4_takeoff_variants", 4)],
)
def test_arming_and_disarming_are_seen(recording, name, flights):
    replay = Replay([1]).play(recording(name))
    assert changes(replay.armed[1]) == [False] + [True, False] * flights


def test_ardupilots_answers_and_words_are_found(recording):
    replay = Replay([1]).play(recording("ap_copter_full_flight"))
    results = [(ack.command, ack.result) for ack in replay.acks[1]]
    assert (400, 4) in results
    assert (400, 0) in results
    assert (22, 4) in results
    assert results.count((176, 0)) == 5
    assert "Arm: System not initialised" in replay.texts[1]
    assert "PreArm: Need Position Estimate" in replay.texts[1]
    assert replay.texts[1][-1] == "Disarming motors"


def test_px4s_answers_and_words_are_found_whole(recording):
    replay = Replay([1]).play(recording("px4_full_flight"))
    results = [(ack.command, ack.result) for ack in replay.acks[1]]
    assert (400, 1) in results
    assert (115, 3) in results
    assert results.count((176, 0)) == 2  # one change of mode, answered twice
    assert "Arming denied: Resolve system health failures first" in replay.texts[1]
    assert replay.texts[1][-3:] == ["RTL: land at destination", "Landing detected", "Disarmed by landing"]


def test_answers_to_another_station_are_not_taken_for_ours(recording):
    ours = Replay([3], component=190).play(recording("ap_via_mavproxy_gcs_heartbeats"))
    theirs = Replay([3], component=230).play(recording("ap_via_mavproxy_gcs_heartbeats"))
    assert sorted(ack.command for ack in ours.acks[3]) == [176, 512]
    assert {ack.command for ack in theirs.acks[3]} == {410}
    assert all(isinstance(ack, CommandAck) for ack in ours.acks[3])


def test_two_copters_on_one_link_keep_their_own_words(recording):
    replay = Replay([1, 2]).play(recording("ap_two_copters_gimbal_adsb_one_link"))
    for system in (1, 2):
        assert "Arm: AHRS: waiting for home" in replay.texts[system]
        assert (400, 0) in [(ack.command, ack.result) for ack in replay.acks[system]]
        assert not replay.vehicles[system].clashing


def test_readiness_is_reported_as_the_autopilots_showed_it(recording):
    for name in ("ap_copter_full_flight", "px4_full_flight"):
        vehicle = Replay([1]).play(recording(name)).vehicles[1]
        assert vehicle.flavour.ready_to_arm(vehicle.state) is True


def test_flights_end_at_home_on_the_ground(recording):
    for name, altitude in (("ap_copter_full_flight", 584.1), ("px4_full_flight", 489.3)):
        state = Replay([1]).play(recording(name)).vehicles[1].state
        assert state.home.altitude == pytest.approx(altitude, abs=0.1)
        assert state.relative_altitude == pytest.approx(0.0, abs=1.0)
        assert not state.armed


def test_a_rover_is_found_as_what_it_is(recording):
    replay = Replay([])
    with replay.hub.vehicle(5) as rover:
        replay.play(recording("ap_rover_drive"))
        assert replay.hub.heard == (5,)
        assert rover.state.heartbeat.type == 10
        assert rover.flavour.surface
        assert rover.what == "a ground_rover on ardupilot"
