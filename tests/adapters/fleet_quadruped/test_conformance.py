"""What every kind of drive must do, whatever its protocol: run on each of them."""

import contextlib
import math

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from fleet.errors import LinkLost
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.drives.base import Power
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.rig import Rig
from tests.adapters.fleet_quadruped.copies import copy_of, quick, standing_dog, stood_up
from tests.adapters.fleet_quadruped.kinds import on_one_kind

HEARD = {"cia402": 0.005, "mit": 0.015, "odrive": 0.025, "moteus": 0.015}
"""Seconds until a fault is heard of: most speak when they are spoken to, an ODrive each third cycle."""
RL_HIP = JOINTS.index("RL_hip") + 1


def angles(rig):
    return [motor.angle for motor in rig.sim.world.motors]


def powers(rig):
    return set(rig.controller.drives.feedback(rig.sim.time).powers)


def test_configuring_twice_changes_nothing(rig):
    rig.controller.drives.configure()
    rig.stand()


def test_nothing_moves_before_it_is_asked_to_stand_up(rig):
    before = angles(rig)
    rig.go(1.0, Twist(0.5, 0.2, 0.5))
    assert angles(rig) == before
    assert rig.mode is BodyMode.OFF


def test_enabling_holds_the_place_and_is_seen_on_all_drives(rig):
    rig.go(0.1)
    before = angles(rig)
    rig.request(BodyRequest.STAND)
    while rig.mode is BodyMode.ENABLING:
        rig.cycle()
    assert powers(rig) == {Power.ENABLED}
    assert max(abs(a - b) for a, b in zip(before, angles(rig), strict=True)) < 0.02
    for joint, motor in zip(rig.dog.all_joints, rig.sim.world.motors, strict=True):
        assert abs(motor.torque) <= 0.05 * joint.kind.torque


def test_twelve_drives_are_enabled_within_a_tenth_of_a_second(rig):
    rig.go(0.1)
    begun = rig.sim.time
    rig.request(BodyRequest.STAND)
    while rig.mode is BodyMode.ENABLING:
        rig.cycle()
    assert rig.sim.time - begun < 0.1


def test_a_drive_that_does_not_come_up_disables_all_others(rig):
    rig.go(0.1)
    rig.request(BodyRequest.STAND)
    rig.sim.fault("mute", RL_HIP)
    rig.go(4.0, until=BodyMode.OFF)
    rig.go(0.1)
    assert rig.mode is BodyMode.OFF
    assert rig.fault.startswith("RL_hip: ")
    assert all(motor.kp == 0 for number, motor in enumerate(rig.sim.world.motors) if number != RL_HIP - 1)


def test_it_stands_walks_and_sits_down(standing):
    standing.go(1.0, Twist(0.4))
    assert standing.mode is BodyMode.WALKING
    standing.go(2.0, until=BodyMode.STANDING)
    assert standing.mode is BodyMode.STANDING
    assert standing.request(BodyRequest.SIT) == ""
    standing.go(3.0, until=BodyMode.OFF)
    standing.go(0.1)
    assert standing.mode is BodyMode.OFF
    assert powers(standing) == {Power.DISABLED}
    assert standing.fault == ""


def test_sitting_down_and_standing_up_can_be_repeated(standing):
    standing.request(BodyRequest.SIT)
    standing.go(3.0, until=BodyMode.OFF)
    assert standing.mode is BodyMode.OFF
    standing.stand()
    standing.request(BodyRequest.SIT)
    standing.go(3.0, until=BodyMode.OFF)
    assert standing.mode is BodyMode.OFF


@pytest.mark.combinations
@pytest.mark.parametrize("cycles", [0, 10, 25])
def test_an_emergency_stop_damps_every_joint_in_the_next_cycle(standing, cycles):
    standing.go(1.0 + cycles * 0.01, Twist(0.5))
    standing.emergency()
    standing.cycle()
    standing.cycle()  # a frame that is written in one cycle is obeyed by the drives in the next
    assert standing.mode is BodyMode.DAMPED
    if standing.dog.drive.protocol == "cia402":
        standing.cycle()  # and on the way there they interpolate
    assert standing.is_compliant()


def test_a_damped_dog_goes_off_and_needs_a_new_command(standing):
    standing.emergency()
    standing.go(3.0, Twist(0.5), until=BodyMode.OFF)
    standing.go(0.1)
    assert (standing.mode, standing.fault) == (BodyMode.OFF, "emergency stop")
    assert powers(standing) == {Power.DISABLED}
    standing.stand()
    assert standing.fault == ""


def test_an_emergency_stop_that_comes_with_a_command_to_stand_up_wins(rig):
    rig.go(0.1)
    rig.emergency()
    assert rig.request(BodyRequest.STAND) == ""
    rig.go(3.0, until=BodyMode.OFF)
    assert (rig.mode, rig.fault) == (BodyMode.OFF, "emergency stop")


@pytest.mark.combinations
@pytest.mark.parametrize("given", [BodyRequest.STAND, BodyRequest.SIT, BodyRequest.RECOVER])
def test_an_emergency_stop_works_while_it_rises_and_sits(rig, given):
    if given is BodyRequest.SIT:
        rig.stand()
    rig.go(0.1)
    rig.request(given)
    rig.go(0.5)
    rig.emergency()
    rig.go(0.05)
    assert rig.mode is BodyMode.DAMPED


def test_a_failed_drive_damps_all_and_stays_latched_until_a_reset(standing):
    standing.go(0.6, Twist(0.5))
    standing.sim.fault("overcurrent", RL_HIP)
    standing.go(0.03)
    assert standing.mode is BodyMode.DAMPED
    assert standing.fault.startswith("RL_hip: over-current")
    standing.go(3.0, until=BodyMode.OFF)
    assert "reset_faults" in standing.request(BodyRequest.STAND)
    assert standing.request(BodyRequest.RESET) == ""
    standing.go(0.1)
    standing.stand()


@on_one_kind
def test_an_empty_battery_makes_it_sit_down(standing):
    standing.sim.fault("battery", 8.0)
    standing.go(6.0, until=BodyMode.OFF)
    assert standing.mode is BodyMode.OFF
    assert standing.fault == "battery: 8 %, it sits down at 10 %"


@on_one_kind
def test_without_fresh_orders_it_stands_and_then_sits(any_dog):
    safety = any_dog.safety.model_copy(update={"abandoned": 3.0})
    rig = standing_dog(any_dog.model_copy(update={"safety": safety}))
    rig.go(0.5, Twist(0.4))
    rig.alive = False
    rig.go(2.3, Twist(0.4), until=BodyMode.STANDING)
    assert rig.mode is BodyMode.STANDING
    rig.go(4.0, Twist(0.4), until=BodyMode.OFF)
    assert rig.mode is BodyMode.OFF


def test_silence_is_found_within_the_time_that_was_set(standing, stopped_alone):
    standing.go(0.6, Twist(0.5))
    last = standing.sim.time - standing.dog.dt  # a cycle asks first, and then its time passes
    while not stopped_alone(standing):
        standing.sim.advance(0.002)
    assert standing.sim.time - last <= standing.dog.drive.timeout + standing.dog.dt
    standing.go(0.02)
    assert standing.mode is BodyMode.DAMPED


def test_the_fault_of_a_drive_damps_all_others_in_the_cycle_that_hears_of_it(standing):
    standing.go(0.6, Twist(0.5))
    began = standing.sim.time
    standing.sim.fault("overcurrent", RL_HIP)
    while (
        standing.mode is not BodyMode.DAMPED
        and standing.sim.time < began + HEARD[standing.dog.drive.protocol]
    ):
        standing.cycle()
    assert standing.mode is BodyMode.DAMPED
    standing.go(0.02)
    assert standing.is_compliant(set(range(12)) - {RL_HIP - 1})


def test_two_dogs_do_not_hear_each_other(any_dog):
    one, other = standing_dog(any_dog), standing_dog(any_dog)
    one.emergency()
    for rig in (one, other):
        rig.go(0.5, Twist(0.4))
    assert (one.mode, other.mode) == (BodyMode.DAMPED, BodyMode.WALKING)


def test_the_drives_stop_by_themselves_when_the_controller_dies(standing, stopped_alone):
    standing.go(0.6, Twist(0.5))
    for _ in range(12):
        standing.sim.advance(0.01)
    assert stopped_alone(standing)


def test_a_mirrored_sign_is_found_before_anything_moves(any_dog):
    wiring = any_dog.joints["RL_knee"]
    mirrored = any_dog.joints | {"RL_knee": wiring.model_copy(update={"sign": -wiring.sign})}
    wrong = type(any_dog).model_validate(any_dog.model_copy(update={"joints": mirrored}).model_dump())
    rig = Rig(wrong, real=any_dog)
    rig.go(0.1)
    before = angles(rig)
    rig.request(BodyRequest.STAND)
    rig.go(1.0)
    assert rig.mode in {BodyMode.DAMPED, BodyMode.OFF}
    assert rig.fault.startswith("RL_knee: is at")
    assert "check its sign and offset" in rig.fault
    assert max(abs(a - b) for a, b in zip(before, angles(rig), strict=True)) < 0.02


def test_standing_up_takes_no_target_beyond_the_limits(rig):
    written = Written(rig)
    rig.stand()
    assert written.targets


FAULTS = ["loss", "delay", "duplicate", "jump", "overcurrent", "mute"]
anything = st.floats(width=32)  # not-a-number and the infinite ones, too
requests = st.one_of(
    st.tuples(st.just("ask"), st.sampled_from(BodyRequest), anything),
    st.tuples(st.just("go"), st.floats(0.02, 0.6), st.tuples(*[st.floats(-5, 5) | anything] * 3)),
    st.tuples(st.just("stop"), st.none(), st.none()),
    st.tuples(st.just("fault"), st.sampled_from(FAULTS), st.none()),
    st.tuples(st.just("silence"), st.floats(0.02, 1.0), st.none()),
)


@pytest.mark.parametrize("protocol", ["cia402", "mit", "odrive", "moteus"])
@given(st.lists(requests, max_size=6), st.booleans())
@settings(max_examples=6, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
def test_no_sequence_of_commands_takes_a_target_beyond_the_limits(dogs, protocol, sequence, stands):
    rig = copy_of(stood_up if stands else Rig, quick(dogs[protocol]))
    written = Written(rig)
    rig.go(0.05)
    with contextlib.suppress(LinkLost):
        for kind, first, second in sequence:
            do(rig, kind, first, second)
    assert written.targets or rig.mode is BodyMode.OFF or not stands


def do(rig, kind, first, second):
    """Do one thing of a sequence."""
    match kind:
        case "ask":
            rig.request(first, second)
        case "go":
            rig.go(first, Twist(*second))
        case "stop":
            rig.emergency()
            rig.cycle()
        case "fault":
            rig.sim.fault(first, {"loss": 0.3, "delay": 0.03, "duplicate": 0.5}.get(first, RL_HIP))
        case "silence":
            rig.sim.advance(first)


class Written:
    """Looks at all targets that are written to the drives, and at what is on the bus."""

    def __init__(self, rig):
        self.rig = rig
        self.targets = 0
        self._write = rig.controller.drives.write
        self._last = None
        rig.controller.drives.write = self.write
        rig.watch = self.wire

    def write(self, targets):
        self.targets += 1
        feedback = self.rig.controller.drives.feedback(self.rig.sim.time)
        for number, joint in enumerate(self.rig.dog.all_joints):
            angle, safety = targets.angles[number], self.rig.dog.safety
            assert joint.low + safety.margin <= angle <= joint.high - safety.margin, joint.name
            assert abs(targets.speeds[number]) <= joint.kind.velocity
            assert abs(targets.torques[number]) <= joint.kind.torque
            if joint.low + safety.margin < angle < joint.high - safety.margin:
                assert abs(angle - feedback.angles[number]) <= safety.following + 1e-9, joint.name
        self._write(targets)

    def wire(self):
        for joint, motor in zip(self.rig.dog.all_joints, self.rig.sim.world.motors, strict=True):
            if motor.kp > 0:
                shifted = 0.51 if joint.name == "RL_hip" else 0.01  # by the fault of its encoder
                assert joint.low - shifted <= motor.target <= joint.high + shifted, joint.name


@pytest.mark.combinations
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_moves_nothing(standing, value):
    standing.go(1.0, Twist(value, value, value))
    assert standing.mode is BodyMode.STANDING
    assert standing.request(BodyRequest.HEIGHT, value) == f"{value} is not a height"
