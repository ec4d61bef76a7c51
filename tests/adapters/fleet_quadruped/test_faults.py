"""Every fault by its name, on each kind of drives: the stage of the stop, and the cause that is told.

The list of what must be survived is one table; what a row cannot say has a test of its own below it.
"""

import re
import threading
from typing import NamedTuple

import pytest

from fleet.errors import LinkLost, LinkRefused
from fleet.link.canbus.frame import CanFrame
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.control.controller import Controller
from fleet_quadruped.reports import health_of
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.lockstep import lockstep
from tests.adapters.fleet_quadruped.copies import standing_in_physics, walking_dog
from tests.adapters.fleet_quadruped.kinds import on_one_kind, on_stiff_and_soft

PROTOCOLS = ("cia402", "mit", "odrive", "moteus")
RL_HIP = JOINTS.index("RL_hip") + 1
RL_KNEE = JOINTS.index("RL_knee") + 1
TELL_VOLTAGE = ("cia402", "odrive", "moteus")
SILENT = ("mit", "odrive", "moteus")  # they say nothing of a fault but in answers


class Case(NamedTuple):
    """A fault that begins in mid-trot; ``within`` seconds the dog is in ``mode`` with this cause."""

    fault: str
    value: float
    within: float
    mode: BodyMode
    cause: str  # a pattern
    drives: tuple[str, ...] = PROTOCOLS


CASES = [
    Case("overcurrent", RL_HIP, 0.03, BodyMode.DAMPED, r"RL_hip: over-current"),
    Case(
        "hot", RL_HIP, 0.03, BodyMode.DAMPED, r"RL_hip: (temperature|rotor too hot|(motor )?over temperature)"
    ),
    Case("short", RL_HIP, 0.25, BodyMode.DAMPED, r"RL_hip: over-current \(emergency 2310h", ("cia402",)),
    Case("short", RL_HIP, 0.25, BodyMode.DAMPED, r"RL_hip: no feedback from id 8 on bus a", SILENT),
    Case("mute", RL_HIP, 0.18, BodyMode.DAMPED, r"RL_hip: no feedback from id 8 on bus a for 0\.1\d s"),
    Case("reboot", RL_HIP, 0.03, BodyMode.DAMPED, r"RL_hip: id 8 (has restarted|switched its torque off)"),
    Case(
        "deaf", RL_HIP, 0.03, BodyMode.DAMPED, r"RL_hip: .*ignores its target \(bit 12 of 6041h", ("cia402",)
    ),
    Case("jump", RL_HIP, 0.03, BodyMode.DAMPED, r"RL_hip: its encoder jumped"),
    Case(
        "stuck",
        RL_HIP,
        0.5,
        BodyMode.DAMPED,
        r"RL_hip: stays at exactly .* its encoder is stuck, or the joint",
    ),
    Case(
        "weak", RL_HIP, 0.5, BodyMode.DAMPED, r"RL_hip: stays at exactly .* wanted .* or the joint is blocked"
    ),
    Case(
        "volts",
        38.0,
        3.0,
        BodyMode.SITTING,
        r"FL_abad: supply at 38.0 V, it sits down at 40 V",
        TELL_VOLTAGE,
    ),
    Case("volts", 38.0, 3.0, BodyMode.SITTING, r"battery: supply at 38.0 V, it sits down at 40 V", ("mit",)),
    Case("lazy", RL_HIP, 3.0, BodyMode.WALKING, r""),
    Case("silent", 1.0, 0.2, BodyMode.DAMPED, r"FL_abad: no feedback from id 1 on bus a"),
    Case("delay", 0.2, 0.5, BodyMode.DAMPED, r"FL_abad: no feedback from id 1 on bus a"),
    Case("duplicate", 0.2, 3.0, BodyMode.WALKING, r""),
]
"""Faults of drives and of their frames. It walks on where some are lost or late: sim/test_walking.py."""
OF_SENSORS = [
    Case("battery", 8.0, 3.0, BodyMode.SITTING, r"battery: 8 %, it sits down at 10 %"),
    Case("frozen", 1.0, 0.4, BodyMode.DAMPED, r"imu: frozen, exactly the same for 0\.3\d s of walking"),
    Case("upside", 1.0, 0.03, BodyMode.DAMPED, r"imu: tilted 3.14 rad, more than 0.785"),
    Case("bms", 1.0, 3.0, BodyMode.WALKING, r""),
    Case("imu", 1.0, 0.2, BodyMode.DAMPED, r"imu: no valid frame for 0\.\d+ s"),
]


@pytest.mark.parametrize(
    ("case", "protocol"),
    [
        pytest.param(case, protocol, id=f"{case.fault}-{case.value:g}-{protocol}")
        for case in CASES
        for protocol in case.drives
    ],
)
def test_a_fault_in_mid_trot_ends_in_its_stage_with_its_cause(dogs, case, protocol):
    check(dogs[protocol], case)


@pytest.mark.combinations
@pytest.mark.parametrize("case", OF_SENSORS, ids=lambda case: case.fault)
def test_a_fault_of_a_sensor_in_mid_trot_ends_in_its_stage_with_its_cause(any_dog, case):
    check(any_dog, case)


def check(dog, case):
    """Have a fault begin in mid-trot, and see how that ends."""
    rig = walking_dog(dog)
    rig.sim.fault(case.fault, case.value)
    rig.go(case.within, Twist(0.4), until=None if case.mode is BodyMode.WALKING else case.mode)
    assert rig.mode is case.mode
    assert re.match(case.cause, rig.fault)
    assert bool(rig.fault) == bool(case.cause)


@pytest.mark.combinations
@pytest.mark.parametrize("fault", ["overcurrent", "mute", "imu"])
def test_what_was_stopped_hard_is_damped_everywhere_then_off_and_reported_as_a_fault(any_dog, fault):
    rig = walking_dog(any_dog)
    rig.sim.fault(fault, RL_HIP)
    while rig.mode is not BodyMode.DAMPED:
        rig.cycle()
    rig.go(0.02)
    healthy = set(range(12)) - {RL_HIP - 1}
    assert rig.is_compliant(healthy)
    rig.go(1.6, Twist(0.4), until=BodyMode.OFF)
    assert rig.mode is BodyMode.OFF
    rig.go(0.02)
    assert all(rig.sim.world.motors[number].kp == 0 for number in healthy)
    health = health_of(rig.state(), 100)
    assert health.level.word == "fault"
    assert health.cause == f"{rig.fault}; look at the dog, then send reset_faults"
    assert rig.fault in rig.request(BodyRequest.STAND)


def test_a_dog_whose_imu_falls_silent_while_it_recovers_lets_go(rig):
    rig.go(0.1)
    assert rig.request(BodyRequest.RECOVER) == ""
    rig.go(0.3)
    rig.sim.fault("imu")
    rig.go(0.2)
    assert rig.mode is BodyMode.DAMPED
    assert rig.fault.startswith("imu: no valid frame for ")


@on_one_kind
def test_a_dog_that_is_asked_to_sit_while_it_recovers_gives_way_where_it_lies(rig):
    rig.go(0.1)
    assert rig.request(BodyRequest.RECOVER) == ""
    rig.go(0.3)
    assert (rig.mode, rig.request(BodyRequest.SIT)) == (BodyMode.RECOVERING, "")
    rig.go(0.1)
    assert rig.mode is BodyMode.SETTLING
    rig.go(1.0, until=BodyMode.OFF)
    assert (rig.mode, rig.fault) == (BodyMode.OFF, "")


# -- before it is asked to stand up ------------------------------------------------------------------


def unconfigured(dog, fault):
    """Return a controller whose simulated dog has a fault before anything is configured."""
    sim, buses = lockstep(dog)
    sim.fault(fault, RL_HIP)
    return Controller(dog, buses)


STRANGERS = (
    r"1000h:0 says profile 401",
    r"register 21 .PMAX. is 25",
    r"firmware 0\.5",
    r"servo\.pid_position\.kp is 75\.\d+",
)
REFUSALS = (
    r"1600h:1 .mapping.: it cannot be mapped",
    r"register 9 .watchdog. is",
    r"parameter 242 .watchdog. is 00000000, not",
    r"servo\.timeout_mode is 0, wanted 12",
)


@pytest.mark.parametrize(
    ("fault", "error", "cause"),
    [
        ("stranger", LinkRefused, rf"^RL_hip: ({'|'.join(STRANGERS)}), wanted"),
        ("abort", LinkRefused, rf"^RL_hip: ({'|'.join(REFUSALS)})"),
        ("mute", LinkLost, r"^RL_hip: id 8 on bus 'a'"),
    ],
)
def test_what_cannot_be_configured_is_reported_by_name(any_dog, fault, error, cause):
    with pytest.raises(error, match=cause):
        unconfigured(any_dog, fault).drives.configure()


def test_a_drive_that_does_not_take_its_mode_is_refused(dog):
    with pytest.raises(LinkRefused, match=r"RL_hip: 6061h:0 .* is 1, wanted 8"):
        unconfigured(dog, "mode").drives.configure()


def test_two_drives_with_one_id_are_reported_and_never_enabled(rig):
    rig.sim.fault("twin", RL_HIP)
    rig.reconnect()
    rig.go(0.2)
    expected = r"RL_hip: two (drives|motors) answer as id 8 on bus a: give each its own"
    assert re.match(expected, health_of(rig.state(), 100).cause)
    assert re.match(expected, rig.request(BodyRequest.STAND))
    assert rig.mode is BodyMode.OFF


@pytest.mark.combinations
@pytest.mark.parametrize("fault", ["overcurrent", "hot"])
def test_a_fault_of_a_resting_dog_is_reported_and_reset_by_command_only(rig, fault):
    rig.sim.fault(fault, RL_HIP)
    rig.go(1.5)
    assert rig.state().fault.startswith("RL_hip: ")
    assert "send reset_faults" in rig.request(BodyRequest.STAND)
    rig.request(BodyRequest.RESET)
    rig.go(0.1)
    assert rig.state().fault == ""
    rig.stand()


@on_one_kind
def test_a_dog_with_an_empty_battery_does_not_stand_up(rig):
    rig.sim.fault("battery", 5.0)
    rig.go(2.0)
    assert rig.request(BodyRequest.STAND) == "battery: 5 %, it sits down at 10 %"


def test_a_drive_that_misses_its_first_enabling_is_reported_again(rig):
    rig.sim.fault("lazy", RL_HIP)
    rig.stand()


def test_drives_that_answer_slowly_are_configured_all_the_same(any_dog):
    _, buses = lockstep(any_dog)
    late = LateBus(buses["a"])
    Controller(any_dog, {"a": late}).drives.configure()
    assert not late.kept


def test_an_answer_that_is_lost_is_asked_for_again(any_dog):
    _, buses = lockstep(any_dog)
    deaf = DeafBus(buses["a"], first_answers(any_dog.drive.protocol))
    Controller(any_dog, {"a": deaf}).drives.configure()
    assert len(deaf.lost) == 12


class DeafBus:
    """A bus on which the first answer of each drive is lost."""

    def __init__(self, bus, answers):
        self.name, self.send, self._bus = bus.name, bus.send, bus
        self.lost, self.answers = set(), answers

    def receive(self, wait):
        heard = []
        for frame in self._bus.receive(wait):
            if self.answers(frame):
                known = frame.id in self.lost
                self.lost.add(frame.id)
                heard += [frame] * known
            else:
                heard.append(frame)
        return heard


def first_answers(protocol):
    """Return what tells whether a frame is an answer while drives are set up."""
    return {
        "cia402": lambda frame: frame.id >> 8 == 5,
        "mit": lambda frame: 0x10 < frame.id < 0x20,
        "odrive": lambda frame: frame.id & 0x1F == 0 and frame.id < 0x200,
        "moteus": lambda frame: frame.fd,
    }[protocol]


class LateBus:
    """A bus on which the first answers are late."""

    def __init__(self, bus):
        self.name, self.send, self._bus = bus.name, bus.send, bus
        self.kept, self._waits = [], 3

    def receive(self, wait):
        self.kept += self._bus.receive(wait)
        if self.kept and self._waits:
            self._waits -= 1
            threading.Event().wait(0.02)
            return []
        frames, self.kept = self.kept, []
        return frames


def test_a_dog_whose_imu_is_upside_down_does_not_stand_up(rig):
    rig.sim.fault("upside")
    rig.go(0.1)
    assert (
        rig.request(BodyRequest.STAND)
        == "it is not upright; send recovery_stand, or check how its IMU is mounted"
    )
    assert rig.mode is BodyMode.OFF


@on_stiff_and_soft
def test_a_motor_without_force_is_a_following_error_in_physics(any_dog):
    rig = standing_in_physics(any_dog)
    rig.sim.fault("weak", RL_KNEE)
    rig.go(1.5, Twist(0.4))
    assert re.match(r"RL_knee: following error, wanted -\d\.\d\d rad, is at -\d", rig.fault)


@on_one_kind
def test_one_odd_value_of_the_battery_does_not_make_it_sit_down(any_dog):
    rig = walking_dog(any_dog)
    rig.sim.fault("battery", 3.0)
    rig.go(1.1, Twist(0.4))
    rig.sim.clear("battery")
    rig.go(2.0, Twist(0.4))
    assert (rig.mode, rig.fault) == (BodyMode.WALKING, "")


@on_one_kind
def test_a_battery_that_says_nothing_is_reported(rig):
    rig.sim.fault("bms")
    rig.go(rig.dog.battery.timeout + 1.2)
    assert health_of(rig.state(), 100).cause.startswith("battery: silent on bus a")


def test_a_storm_of_emergencies_is_one_fault_with_the_first_cause(dog):
    rig = walking_dog(dog)
    rig.sim.fault("overcurrent", RL_HIP)
    for code in range(0x1000, 0x1000 + 2000):
        rig.buses["a"].arrive(CanFrame(0x080 + 3, code.to_bytes(2, "little") + bytes([0x21]) + bytes(5)))
    rig.go(0.02, Twist(0.4))
    assert rig.mode is BodyMode.DAMPED
    first = rig.fault
    rig.go(1.0, Twist(0.4))
    assert rig.fault == first


def test_a_burst_of_lost_frames_is_walked_through(any_dog):
    rig = walking_dog(any_dog)
    rig.sim.fault("silent")
    rig.go(0.03, Twist(0.4))
    rig.sim.clear("silent")
    rig.go(1.0, Twist(0.4))
    assert (rig.mode, rig.fault) == (BodyMode.WALKING, "")


@pytest.mark.combinations
@pytest.mark.parametrize(("fault", "share"), [("reorder", 0.1), ("corrupt", 0.01)])
def test_frames_that_are_spoiled_or_out_of_order_end_with_a_cause_or_not_at_all(any_dog, fault, share):
    rig = walking_dog(any_dog)
    rig.sim.fault(fault, share)
    rig.go(1.5, Twist(0.4))
    assert rig.mode is BodyMode.WALKING or re.match(r"(..)_(abad|hip|knee): |imu: ", rig.fault)


# -- links that go and come --------------------------------------------------------------------------


@pytest.mark.combinations
@pytest.mark.parametrize("fault", ["mute", "silent"])
def test_drives_that_go_away_while_it_rests_are_a_lost_link(rig, fault):
    rig.go(0.1)
    rig.sim.fault(fault, RL_HIP)
    with pytest.raises(LinkLost, match=r"id \d+ (on bus 'a' is silent|.*)"):
        rig.go(3.0)


def test_a_drive_that_restarts_in_motion_is_configured_again_after_the_reset(any_dog):
    rig = walking_dog(any_dog)
    rig.sim.fault("reboot", RL_HIP)
    rig.go(3.0, until=BodyMode.OFF)
    rig.go(0.2)
    assert rig.mode is BodyMode.OFF
    assert rig.request(BodyRequest.RESET) == ""
    with pytest.raises(LinkLost, match="RL_hip: id 8"):
        rig.go(0.1)


def test_a_bus_that_is_unplugged_and_back_finds_a_dog_that_goes_off_and_stays_so(any_dog, stopped_alone):
    rig = walking_dog(any_dog)
    rig.buses["a"].cut = True
    with pytest.raises(LinkLost, match="bus 'a' is gone"):
        rig.go(0.1, Twist(0.4))
    for _ in range(30):
        rig.sim.advance(0.01)
    assert stopped_alone(rig)
    rig.buses["a"].cut = False
    rig.reconnect()
    rig.go(2.5, Twist(0.4), until=BodyMode.DAMPED)
    rig.go(2.5, Twist(0.4), until=BodyMode.OFF)
    rig.go(0.1, Twist(0.4))
    assert rig.mode is BodyMode.OFF
    assert all(motor.kp == motor.kd == 0 for motor in rig.sim.world.motors)
    rig.request(BodyRequest.RESET)
    rig.go(0.1)
    rig.stand()


# -- time --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seconds", [0.3, 5.0])
def test_a_controller_that_was_asleep_finds_its_drives_stopped_and_gives_up(any_dog, seconds, stopped_alone):
    rig = walking_dog(any_dog)
    for _ in range(round(seconds / 0.01)):
        rig.sim.advance(0.01)
    assert stopped_alone(rig)
    rig.go(0.05, Twist(0.4))
    assert rig.mode is BodyMode.DAMPED
    assert re.match(r"FL_abad: .*(the drive is stopping|did not reach|jumped)", rig.fault)


@pytest.mark.parametrize("seconds", [2.0, 3600.0])
def test_a_clock_that_jumps_ahead_counts_as_a_long_silence_and_makes_no_jump_of_a_joint(any_dog, seconds):
    rig = walking_dog(any_dog)
    rig.go(0.02, Twist(0.4))  # no heartbeat is due in the next cycle
    before = [motor.target for motor in rig.sim.world.motors]
    rig.skew = seconds
    rig.go(0.01, Twist(0.4))
    moved = [abs(a - motor.target) for a, motor in zip(before, rig.sim.world.motors, strict=True)]
    assert max(moved) <= any_dog.safety.step
    rig.go(0.5, Twist(0.4))
    if any_dog.drive.protocol in {"cia402", "odrive"}:  # the heartbeats that came meanwhile are not seen
        assert re.match(rf"FL_abad: no heartbeat .* from id 1 for {seconds:.0f}\.", rig.fault)
        assert rig.mode is BodyMode.DAMPED
    else:
        assert (rig.mode, rig.fault) == (BodyMode.WALKING, "")


def test_an_order_from_before_a_jump_of_the_clock_stops_it_softly(mit_dog):
    rig = walking_dog(mit_dog)
    rig.alive, rig.skew = False, 2.0
    rig.go(2.0, Twist(0.4))
    assert (rig.mode, rig.fault) == (BodyMode.STANDING, "")


# -- heat --------------------------------------------------------------------------------------------


def test_a_warm_joint_slows_the_dog_before_it_sits_down(any_dog):
    rig = walking_dog(any_dog)
    rig.go(1.0, Twist(0.8))
    cool = rig.controller.body.walker.odometry.twist.x
    rig.sim.fault("warm", RL_HIP)
    rig.go(3.5, Twist(0.8))
    for _ in range(20):  # it gets warmer, and some drives report that once a second
        rig.go(0.1, Twist(0.8))
        if rig.state().warning == "joints are warm: speed is held to 30%":
            break
    assert rig.state().warning == "joints are warm: speed is held to 30%"
    assert rig.controller.body.walker.odometry.twist.x < 0.6 * cool
    assert max(
        temperature for temperature in rig.state().temperatures if temperature is not None
    ) == pytest.approx(82, abs=2)
    rig.go(2.8, Twist(0.8), until=BodyMode.SITTING)
    assert rig.mode is BodyMode.SITTING
    assert re.match(r"RL_hip: 8\d C, 85 is its limit", rig.fault)


# -- who resets --------------------------------------------------------------------------------------


def test_a_fault_is_reset_by_a_rising_edge_and_never_unasked(dog):
    rig = walking_dog(dog)
    rig.sim.fault("overcurrent", RL_HIP)
    rig.go(3.0, until=BodyMode.OFF)
    rig.go(1.0)
    assert set(control_words(rig)) == {0x00}
    rig.request(BodyRequest.RESET)
    rig.go(0.02)
    assert control_words(rig)[-4:] == [0x00, 0x80, 0x00, 0x00]


def control_words(rig):
    """Return the last control words that went to the failed drive."""
    return [int.from_bytes(frame.data[:2], "little") for frame in rig.buses["a"].sent if frame.id == 0x208]
