"""A machine that walks by itself, by frames of its own and as a CANopen node, in lock-step."""

import functools
import math
import re
import struct

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fleet import CanFrame
from fleet.errors import LinkLost, LinkRefused
from fleet_quadruped.any_description import load_body
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.frames import FrameDecoder
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.safety.stages import BodyMode

NOWHERE = {"index": 0x5FFF, "type": "u8", "value": 1}


@pytest.fixture
def standing(walker_rig):
    walker_rig.go(0.2)
    assert walker_rig.request(BodyRequest.STAND) == ""
    walker_rig.go(1.5)
    assert walker_rig.state.mode == "standing"
    return walker_rig


def changed(walker, **sections):
    """Return a description with other values in its sections."""
    tree = walker.model_dump(exclude_none=True)
    for name, values in sections.items():
        tree[name] |= values
    return type(walker).model_validate(tree)


def requested(walker_rig):
    """Return the velocities that were sent last."""
    decoder = FrameDecoder(walker_rig.walker.wire.velocity)
    found = [decoder.decode(frame.id, frame.data) for frame in walker_rig.bus.sent]
    return [each for each in found if each]


def test_it_stands_walks_and_sits(standing):
    standing.go(2.0, Twist(0.4, 0.1, 0.0))
    assert standing.state.mode == "walking"
    assert tuple(standing.machine.twist) == pytest.approx((0.4, 0.1, 0.0), abs=0.01)
    assert (standing.state.x, standing.state.y) == pytest.approx(standing.machine.place[:2], abs=0.05)
    standing.go(1.5)
    assert standing.request(BodyRequest.SIT) == ""
    standing.go(1.5)
    assert standing.state.mode == "off"


def test_it_turns_and_knows_its_heading(standing):
    standing.go(2.0, Twist(0.0, 0.0, 0.8))
    w, _, _, z = standing.state.rotation
    assert z / w == pytest.approx(math.tan(standing.machine.place[2] / 2), abs=0.05)


def test_one_that_lies_is_sent_no_velocity(walker_rig):
    walker_rig.go(1.0, Twist(0.5))
    assert all(set(each.values()) == {0.0} for each in requested(walker_rig))
    assert walker_rig.machine.mode is BodyMode.OFF


def test_without_a_fresh_order_it_stands_still(standing):
    standing.go(1.0, Twist(0.5))
    standing.alive = False
    standing.go(2.0, Twist(0.5))
    assert standing.state.mode == "standing"
    assert set(requested(standing)[-1].values()) == {0.0}


def test_when_we_are_dead_it_stands_still_by_itself(standing):
    standing.go(1.0, Twist(0.5))
    for _ in range(60):
        standing.machine.advance(standing.walker.dt)
    assert tuple(standing.machine.twist) == pytest.approx((0, 0, 0), abs=0.01)


def test_an_emergency_stop_is_obeyed_in_its_cycle_and_latched(standing):
    standing.go(1.0, Twist(0.5))
    standing.emergency()
    standing.cycle()
    assert standing.machine.mode is BodyMode.DAMPED
    standing.go(2.0, Twist(0.5))
    assert (standing.state.mode, standing.state.fault) == ("off", "emergency stop")
    assert standing.state.stopped == 1
    assert standing.request(BodyRequest.STAND) == ""  # the host asks only after its release
    assert standing.state.fault == ""


def test_with_lost_frames_all_commands_come_through(standing):
    standing.machine.fault("loss", 0.05)
    standing.go(2.0, Twist(0.5))
    assert standing.machine.twist.x == pytest.approx(0.5, abs=0.1)
    standing.emergency()
    standing.go(2.0)
    assert standing.machine.mode is BodyMode.OFF
    assert standing.request(BodyRequest.STAND) == ""


def test_an_error_of_the_machine_is_latched_until_it_is_reset(standing):
    standing.machine.fault("error", 2)
    standing.go(0.2, Twist(0.5))
    assert standing.state.fault.endswith("motor too hot (error 2)")
    standing.machine._error = 0
    standing.go(1.0, Twist(0.5))
    assert tuple(standing.machine.twist) == pytest.approx((0, 0, 0), abs=0.01)
    assert standing.request(BodyRequest.RESET) == ""
    standing.go(1.0, Twist(0.5))
    assert standing.machine.twist.x > 0.3


def test_an_emergency_stop_does_not_make_up_for_the_reset_of_an_error(standing):
    standing.machine.fault("error", 2)
    standing.go(0.2)
    standing.machine.fault("error", 0)
    standing.emergency()
    standing.go(2.0)
    assert "motor too hot (error 2); look at the machine, then send reset_faults" in standing.request(
        BodyRequest.STAND
    )


def test_a_reset_does_not_end_an_emergency_stop_that_the_machine_has_not_obeyed(standing):
    obeyed, standing.machine._commands = standing.machine._commands, {}
    standing.go(0.5, Twist(0.5))
    standing.emergency()
    standing.go(0.5, Twist(0.5))
    assert standing.request(BodyRequest.RESET) == "it has not carried out the emergency stop yet"
    standing.go(0.5, Twist(0.5))
    assert set(requested(standing)[-1].values()) == {0.0}
    standing.machine._commands = obeyed
    standing.go(0.1)
    assert standing.machine.mode is BodyMode.DAMPED


def test_a_mode_that_the_description_does_not_name_is_reported_and_not_left_alone(standing):
    standing.machine._numbers[BodyMode.STANDING] = 9
    standing.go(0.2)
    assert (standing.state.mode, standing.state.warning) == (
        "unknown",
        "it reports mode 9, which is not in modes",
    )
    assert not standing.controller.resting


def test_a_mode_without_a_name_is_not_the_end_of_sitting_down(standing):
    standing.machine._numbers |= {BodyMode.STANDING: 9, BodyMode.SITTING: 9, BodyMode.OFF: 9}
    assert standing.request(BodyRequest.SIT) == "sit_down was not taken within 1 s: it is unknown"


def test_a_machine_in_a_mode_without_a_name_is_not_told_to_get_up(standing):
    standing.machine._numbers[BodyMode.STANDING] = 9
    standing.go(0.2)
    assert standing.request(BodyRequest.STAND) == "it reports mode 9, which is not in modes"


def test_a_machine_that_falls_silent_is_not_led_on_and_then_lost(standing):
    standing.machine.fault("mute")
    standing.go(0.5, Twist(0.5))
    assert "no state for" in standing.state.fault
    assert set(requested(standing)[-1].values()) == {0.0}
    with pytest.raises(LinkLost, match="is silent on bus 'a'"):
        standing.go(3.0)


def test_a_machine_that_tips_is_stopped(make_walker_rig):
    walker_rig = make_walker_rig(load_body(EXAMPLE.with_name("self-walking-canopen.yaml")))
    walker_rig.go(0.2)
    walker_rig.request(BodyRequest.STAND)
    walker_rig.go(1.5)
    walker_rig.machine.fault("tip", 1.0)
    walker_rig.go(2.0)
    assert walker_rig.state.fault == "imu: tilted 1.00 rad, more than 0.785"
    assert walker_rig.machine.mode is BodyMode.OFF


def test_with_an_empty_battery_it_sits_down(standing):
    standing.machine.fault("battery", 8.0)
    standing.go(4.0)
    assert standing.state.mode == "off"
    assert standing.state.fault == "battery: 8 %, it sits down at 10 %"


def test_asked_to_leave_it_sits_down(standing):
    standing.order = type(standing.order)(leave=True, alive=standing.machine.time)
    standing.go(2.0)
    assert standing.controller.resting


def test_it_changes_its_height_within_its_limits(standing):
    assert standing.request(BodyRequest.HEIGHT, 1.0) == ""
    assert standing.machine.height == pytest.approx(standing.walker.highest)


def test_a_command_that_is_not_taken_is_reported(walker, make_walker_rig):
    section, other = ("frames", {"id": 0x7AA, "data": "01"}) if walker.frames else ("objects", NOWHERE)
    walker_rig = make_walker_rig(changed(walker, **{section: {"stand_up": other}}), real=walker)
    walker_rig.go(0.2)
    assert re.search("was not taken within 1 s|SDO abort 06020000h", walker_rig.request(BodyRequest.STAND))
    assert walker_rig.machine.mode is BodyMode.OFF


def test_a_description_without_recovery_refuses_it(make_walker_rig):
    lacking = changed(load_body(EXAMPLE.with_name("self-walking.yaml")), frames={"recovery_stand": None})
    walker_rig = make_walker_rig(lacking)
    walker_rig.go(0.2)
    assert walker_rig.request(BodyRequest.RECOVER) == "this machine's description has no recovery_stand"


def test_it_recovers(walker_rig):
    walker_rig.go(0.2)
    assert walker_rig.request(BodyRequest.RECOVER) == ""
    walker_rig.go(3.0)
    assert walker_rig.state.mode == "standing"


def test_a_node_that_cannot_be_set_up_is_named(make_walker_rig):
    walker = load_body(EXAMPLE.with_name("self-walking-canopen.yaml"))
    with pytest.raises(LinkRefused, match=r"mule: 1029h:1 .*no such object"):
        make_walker_rig(walker, real=changed(walker, objects={"setup": ()}))


@given(st.lists(st.tuples(*[st.floats(-50, 50)] * 3), min_size=1, max_size=6))
@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_velocity_beyond_the_limits_is_ever_sent(walker, make_walker_rig, twists):
    walker_rig, pace = make_walker_rig(walker), walker.pace
    walker_rig.go(0.2)
    walker_rig.request(BodyRequest.STAND)
    walker_rig.go(1.2)
    for twist in twists:
        walker_rig.go(0.4, Twist(*twist))
        for each in requested(walker_rig):
            assert abs(each["x"]) <= pace.speed + 1e-3
            assert abs(each["y"]) <= pace.strafe + 1e-3
            assert abs(each["turn"]) <= pace.turn + 1e-3


FLOATS = st.lists(st.sampled_from([float("nan"), float("inf"), 3.4e38, -3.4e38, 0.5]), max_size=2)
DATA = st.one_of(st.binary(max_size=8), FLOATS.map(lambda them: struct.pack(f"<{len(them)}f", *them)))
FACTORS = {
    "as described": {},
    "floats": {"type": "f32"},
    "huge floats": {"type": "f32", "scale": 1e300},
}


@functools.cache
def telling(name):
    """Return a machine that tells each value in a frame of its own, and a strategy for its frames."""
    factor, described = FACTORS[name], load_body(EXAMPLE.with_name("self-walking.yaml"))
    tree = described.model_dump(exclude_none=True)
    tree["frames"]["state"] = [
        {"id": frame["id"] + number, "fields": {name: {**field, **factor, "at": 0}}}
        for frame in tree["frames"]["state"]
        for number, (name, field) in enumerate(frame["fields"].items())
    ]
    walker = type(described).model_validate(tree)
    identifiers = st.sampled_from([frame.id for frame in (*walker.frames.state, *walker.frames.slow)])
    return walker, st.lists(st.builds(CanFrame, identifiers, DATA), max_size=12)


@pytest.mark.parametrize("factor", FACTORS)
@given(data=st.data())
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_frame_on_the_bus_ends_the_control_of_a_machine_or_hides_a_stop(make_walker_rig, factor, data):
    walker, frames = telling(factor)
    walker_rig = make_walker_rig(walker)
    for frame in data.draw(frames):
        walker_rig.bus.arrive(frame)
        walker_rig.cycle()
    state = walker_rig.state
    assert all(map(math.isfinite, (state.x, state.y, *state.twist, *state.rotation)))
    walker_rig.emergency()
    walker_rig.cycle()
    assert walker_rig.bus.sent[-1] == walker.frames.emergency_stop.frame


# -- frames as makers want them ----------------------------------------------------------------------


INTEGRITY = {"counter": {"at": 6}, "checksum": {"at": 7, "header": True}}


@pytest.fixture
def protected(make_walker_rig):
    """Return a machine of which every frame is padded, counted and has a checksum, as AgileX's version 1."""
    tree = load_body(EXAMPLE.with_name("self-walking.yaml")).model_dump(exclude_none=True)
    frames = tree["frames"]
    for name in ("stand_up", "sit_down", "emergency_stop", "recovery_stand", "reset_faults"):
        frames[name] |= INTEGRITY | {"data": frames[name]["data"].ljust(16, "0")}
    for padded in (frames["velocity"], frames["height"], *frames["state"]):
        padded.update(INTEGRITY, dlc=8)
    walker = type(load_body(EXAMPLE.with_name("self-walking.yaml"))).model_validate(tree)
    return make_walker_rig(walker)


def test_a_machine_with_counters_and_checksums_walks(protected):
    protected.go(0.2)
    assert protected.request(BodyRequest.STAND) == ""
    protected.go(1.5)
    protected.go(2.0, Twist(0.4))
    assert protected.state.mode == "walking"
    assert protected.machine.twist.x == pytest.approx(0.4, abs=0.01)
    assert {len(frame.data) for frame in protected.bus.sent if frame.id in {0x111, 0x131}} == {8}
    protected.emergency()
    protected.go(0.2)
    assert protected.state.mode == "damped"


def test_a_machine_whose_counter_stands_still_is_silent(protected):
    protected.go(0.2)
    protected.machine._integrity = {
        number: Frozen(integrity) for number, integrity in protected.machine._integrity.items()
    }
    with pytest.raises(LinkLost, match="silent"):
        protected.go(3.0)


class Frozen:
    """A counter that does not go on."""

    def __init__(self, integrity):
        self._integrity, self._data = integrity, {}

    def put(self, data):
        return self._data.setdefault("first", self._integrity.put(data))


def test_the_example_speaks_agilex_version_2(make_walker_rig):
    walker_rig = make_walker_rig(load_body(EXAMPLE.with_name("self-walking.yaml")))
    walker_rig.go(0.2)
    walker_rig.request(BodyRequest.STAND)
    walker_rig.go(1.5)
    walker_rig.go(2.0, Twist(0.5, 0.1, -0.2))
    velocity = [frame.data for frame in walker_rig.bus.sent if frame.id == 0x111][-1]
    assert velocity == bytes.fromhex("01F4 FF38 0064 0000")  # forward, turn, left, steering


# -- whether it does what it is asked ----------------------------------------------------------------


def test_a_machine_that_is_asked_to_walk_and_stands_is_reported(standing):
    standing.machine.fault("idle")
    standing.go(2.5, Twist(0.5))
    assert standing.state.warning == (
        f"{standing.walker.robot.name}: requested 0.50 m/s and 0.00 rad/s, reports 0.00 m/s and 0.00 rad/s: "
        "it is blocked, or does not follow"
    )
    standing.go(0.1)
    assert standing.state.fault == ""


@pytest.mark.parametrize("twist", [Twist(0.0, 0.2), Twist(0.0, 0.0, 0.8), Twist(-0.4), Twist(0.3, 0.0, 0.6)])
def test_a_machine_that_obeys_is_not_blamed(standing, twist):
    for requested in (twist, Twist(*(-part for part in twist)), Twist(), twist):
        for _ in range(30):
            standing.go(0.1, requested)
            assert standing.state.warning == standing.state.fault == ""


def test_a_machine_that_walks_unasked_is_stopped(standing):
    standing.machine.fault("runs")
    standing.go(2.2)
    assert standing.state.fault == (
        f"{standing.walker.robot.name}: requested to stand still, reports 0.50 m/s and 0.00 rad/s"
    )
    assert standing.state.mode == "damped"
