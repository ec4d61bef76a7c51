"""What has to be true before a vehicle is asked for anything; each refusal says why, and what helps."""

import math
from types import SimpleNamespace

import msgspec
import pytest

from fleet import GeoPoint, NotReady, Unsupported, Vector3
from fleet_mavlink.constants import Landed
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.preconditions import (
    is_standing,
    known_heading,
    known_position,
    moved_flavour,
    require_connection,
    require_control,
    require_has,
    require_heartbeat,
    require_movable,
)
from fleet_mavlink.state import SILENCE, Angles, VehicleState

ROVER, ARDUPILOT = 10, 3
OURS = SimpleNamespace(lost_to="", taker="")
LOST = SimpleNamespace(lost_to="POSCTL", taker="POSCTL: low battery")


@pytest.fixture
def it(harness):
    """Return a multirotor that was heard twice, is armed, flies, and knows where it is."""
    it = harness()
    for _ in range(2):
        it.beat(armed=True)
    place(it, landed=Landed.IN_AIR)
    return it


def place(it, **changes):
    """Give it a position and an attitude of now, and other changes of its state."""
    now = it.clock.monotonic()
    basics = {
        "position": GeoPoint(47.0, 8.0, 500.0),
        "position_at": now,
        "attitude": Angles(0.0, 0.0, -0.5),
        "attitude_at": now,
        "landed": it.vehicle.state.landed,
    }
    it.vehicle.state = msgspec.structs.replace(it.vehicle.state, **(basics | changes))


def hear_as(it, beat):
    """Let it be another kind of vehicle."""
    it.vehicle.state = msgspec.structs.replace(it.vehicle.state, heartbeat=beat)


def test_a_vehicle_that_flies_is_ours_and_knows_its_place_may_be_moved(it):
    require_heartbeat(it.vehicle)
    require_connection(it.vehicle)
    require_control(it.vehicle, OURS)
    require_movable(it.vehicle, OURS)


@pytest.mark.parametrize(
    "require",
    [
        require_heartbeat,
        require_connection,
        lambda vehicle: require_control(vehicle, OURS),
        lambda vehicle: require_movable(vehicle, OURS),
    ],
)
def test_nothing_is_asked_of_a_vehicle_that_is_silent(it, require):
    it.clock.advance(SILENCE + 0.1)
    with pytest.raises(NotReady, match="no heartbeat from system 1") as refused:
        require(it.vehicle)
    assert refused.value.hint == "check the link and its power"


@pytest.mark.parametrize(
    "require", [require_connection, lambda vehicle: require_movable(vehicle, OURS)], ids=["asked", "moved"]
)
def test_nothing_is_asked_while_two_vehicles_use_one_id_but_what_needs_only_a_heartbeat(it, require):
    it.vehicle._clash_at = it.clock.monotonic()
    with pytest.raises(NotReady, match="two vehicles use system id 1"):
        require(it.vehicle)
    require_heartbeat(it.vehicle)


def test_a_vehicle_that_a_pilot_has_is_not_moved_and_its_taker_is_named(it):
    for require in (require_control, require_movable):
        with pytest.raises(
            NotReady, match="a pilot or a fail-safe has it, in POSCTL: low battery"
        ) as refused:
            require(it.vehicle, LOST)
        assert refused.value.hint == "send hover to take it"
    require_connection(it.vehicle)


@pytest.mark.parametrize(
    ("armed", "landed"), [(True, Landed.ON_GROUND), (False, Landed.IN_AIR), (False, Landed.ON_GROUND)]
)
def test_what_does_not_fly_is_not_moved(it, armed, landed):
    it.beat(armed=armed)
    place(it, landed=landed)
    with pytest.raises(NotReady, match="not in the air") as refused:
        require_movable(it.vehicle, OURS)
    assert refused.value.hint == "send takeoff first"


def test_what_may_or_may_not_fly_is_not_moved(it):
    place(it, landed=Landed.UNDEFINED, relative_altitude=None)
    with pytest.raises(NotReady, match="not in the air"):
        require_movable(it.vehicle, OURS)


@pytest.mark.parametrize("armed", [True, False])
def test_a_rover_is_moved_once_it_is_armed(it, armed):
    hear_as(it, Heartbeat(ROVER, ARDUPILOT, 0x80 if armed else 0, 15, 4))
    if armed:
        require_movable(it.vehicle, OURS)
        return
    with pytest.raises(NotReady, match="it is not armed") as refused:
        require_movable(it.vehicle, OURS)
    assert refused.value.hint == "send arm first"


@pytest.mark.parametrize("old", ["position_at", "attitude_at"])
def test_a_place_of_the_last_second_is_needed(it, old):
    place(it, **{old: it.clock.monotonic() - 0.9})
    require_movable(it.vehicle, OURS)
    place(it, **{old: it.clock.monotonic() - 1.1})
    with pytest.raises(NotReady, match="no position of the last second"):
        require_movable(it.vehicle, OURS)


@pytest.mark.parametrize(("flags", "trusted"), [(None, True), (0x10, True), (0x0F, False)])
def test_a_place_that_the_estimator_does_not_confirm_is_not_trusted(it, flags, trusted):
    place(it, estimator_flags=flags)
    if trusted:
        require_movable(it.vehicle, OURS)
    else:
        with pytest.raises(NotReady, match="can be trusted"):
            require_movable(it.vehicle, OURS)


def test_a_kind_that_is_not_moved_here_is_named(it):
    hear_as(it, Heartbeat(ROVER, 12, 0x80, 0, 4))  # PX4 on a rover
    for require in (moved_flavour, lambda vehicle: require_control(vehicle, OURS)):
        with pytest.raises(Unsupported, match="which is not moved here: it is watched, and stopped"):
            require(it.vehicle)
    with pytest.raises(Unsupported, match="which is not moved here"):
        require_has(it.vehicle, "takeoff")
    require_has(it.vehicle, "emergency_stop")


def test_a_vehicle_that_was_never_heard_has_no_flavour_yet(harness):
    with pytest.raises(NotReady, match="no heartbeat"):
        moved_flavour(harness().vehicle)
    require_has(harness().vehicle, "takeoff")


@pytest.mark.parametrize(
    ("velocity", "stands"),
    [(None, False), (Vector3(), True), (Vector3(0.3, 0.3, 0.2), True), (Vector3(0.0, 0.0, 0.6), False)],
)
def test_what_moves_or_may_move_does_not_stand(velocity, stands):
    assert is_standing(VehicleState(velocity=velocity)) is stands


def test_place_and_heading_are_unknown_until_the_first(it, harness):
    assert known_position(it.vehicle) == GeoPoint(47.0, 8.0, 500.0)
    assert known_heading(it.vehicle) == pytest.approx(math.tau - 0.5)
    for known in (known_position, known_heading):
        with pytest.raises(NotReady, match="is unknown"):
            known(harness().vehicle)
