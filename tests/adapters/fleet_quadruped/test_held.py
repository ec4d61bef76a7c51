"""A dog that stands, or is held by its drives, never falls: whoever leaves, returns, or was cut off."""

import pytest

from fleet.errors import LinkLost, LinkRefused
from fleet_quadruped.bench_tools import BenchSession
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.control.loop import ControlLoop
from fleet_quadruped.control.orders import Order
from fleet_quadruped.drives.base import Power
from fleet_quadruped.drives.cia402.drive import Cia402Drives
from fleet_quadruped.drives.cia402.states import DriveState
from fleet_quadruped.reports import health_of
from fleet_quadruped.robot.names import JOINTS
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.mujoco_world import MujocoWorld
from fleet_quadruped.sim.rig import Rig
from tests.adapters.fleet_quadruped.copies import copy_of, standing_dog, stood_up, up

RL_HIP = JOINTS.index("RL_hip") + 1
GENTLE = 0.5  # m/s of its drop


class Watched(Rig):
    """A dog in physics whose greatest speed of falling is noted."""

    def __init__(self, dog, **options):
        super().__init__(dog, MujocoWorld(dog), **options)
        self.drop = 0.0
        self.watch = self.note

    def note(self):
        self.drop = max(self.drop, self.sim.world.fall_speed)

    def pass_time(self, seconds):
        """Let time pass without a controller."""
        for _ in range(round(seconds / 0.01)):
            self.sim.advance(0.01)
            self.note()

    @property
    def height(self):
        return self.sim.world.place()[2]

    def states(self):
        return {drive.state for drive in self.sim.drives}


def watched(dog):
    return up(Watched(dog))


def trotting(dog):
    rig = copy_of(watched, dog)
    rig.go(1.5, Twist(0.5))
    return rig


def trotting_with_simple_drives(dog):
    """Return a dog in mid-trot whose drives lack the object 1029h."""
    rig = Watched(dog)
    for drive in rig.sim.drives:
        drive.sdo.be_simple()
    rig.controller.drives.configure()
    rig.stand()
    rig.go(1.5, Twist(0.5))
    return rig


@pytest.fixture(params=[watched, trotting], ids=["standing", "trotting"])
def upright(dog, request):
    return copy_of(request.param, dog)


def test_a_controller_that_is_started_again_lets_a_held_dog_down_gently(upright):
    upright.pass_time(1.0)  # the controller is dead
    assert upright.states() == {DriveState.QUICK_STOP}
    assert upright.height > 0.2
    upright.reconnect()
    upright.go(0.2)
    assert upright.mode is BodyMode.DAMPED
    upright.go(2.5, until=BodyMode.OFF)
    upright.go(0.1)
    assert upright.mode is BodyMode.OFF
    assert upright.states() == {DriveState.SWITCH_ON_DISABLED}
    assert upright.height < 0.15
    assert upright.drop < GENTLE
    upright.stand()


def test_a_held_dog_is_reported_and_its_joints_are_led_from_where_they_are(upright):
    upright.pass_time(0.5)
    before = [motor.angle for motor in upright.sim.world.motors]
    upright.reconnect()
    while upright.mode is not BodyMode.DAMPED:
        upright.cycle()
    upright.go(0.03)
    after = [motor.target for motor in upright.sim.world.motors]
    assert max(abs(a - b) for a, b in zip(before, after, strict=True)) < 0.1
    assert health_of(upright.state(), 100).cause == "it may have been held by its drives, and is lowered"


def test_a_controller_that_is_started_again_at_once_finds_drives_that_are_still_enabled(upright):
    upright.reconnect()
    upright.go(1.0, until=BodyMode.DAMPED)
    upright.go(3.0, until=BodyMode.OFF)
    upright.go(0.1)
    assert upright.states() == {DriveState.SWITCH_ON_DISABLED}
    assert upright.drop < GENTLE


@pytest.mark.combinations
@pytest.mark.parametrize("make", [trotting, trotting_with_simple_drives], ids=["with 1029h", "without 1029h"])
@pytest.mark.parametrize("seconds", [0.3, 0.8, 5.0])
def test_a_cable_that_is_cut_and_mended_does_not_drop_it(dog, seconds, make):
    rig = copy_of(make, dog)
    rig.sim.fault("silent")
    try:
        rig.go(seconds)
        lost = False
    except LinkLost:
        lost = True
        rig.pass_time(4.0)
    assert lost == (seconds > 1.0)
    assert rig.height > 0.2
    rig.sim.clear("silent")
    if lost:
        rig.reconnect()
        rig.go(1.0, until=BodyMode.DAMPED)
    rig.go(3.5, until=BodyMode.OFF)
    rig.go(0.1)
    assert rig.mode is BodyMode.OFF
    assert rig.states() == {DriveState.SWITCH_ON_DISABLED}
    assert rig.drop < GENTLE


def test_a_drive_that_does_not_go_on_keeps_the_dog_held_until_a_person_holds_it(dog):
    rig = copy_of(watched, dog)
    rig.sim.fault("stays", RL_HIP)
    rig.pass_time(0.5)
    rig.reconnect()
    rig.go(3.0)
    assert rig.mode is BodyMode.DAMPED
    assert rig.height > 0.2
    assert rig.fault == (
        "RL_hip: its drive does not leave quick stop: it is held and cannot be lowered; "
        "hold the dog: reset_faults switches torque off"
    )
    assert "it is damped" in rig.request(BodyRequest.STAND)
    assert rig.request(BodyRequest.RESET) == ""
    rig.go(0.5)
    assert rig.states() == {DriveState.SWITCH_ON_DISABLED}


def test_a_leg_that_fails_in_mid_trot_does_not_let_the_others_fall(dog):
    rig = copy_of(trotting, dog)
    rig.sim.fault("mute", RL_HIP)
    rig.go(3.0, until=BodyMode.OFF)
    rig.go(0.2)
    assert rig.mode is BodyMode.OFF
    assert rig.drop < GENTLE


def test_nothing_is_written_to_drives_before_they_have_reported_whether_they_hold_the_dog(dog):
    rig = standing_dog(dog)
    rig.reconnect()
    rig.sim.fault("silent")
    rig.go(0.5)
    assert not [frame for frame in rig.buses["a"].sent if 0x200 < frame.id < 0x280]


def test_motors_that_say_no_status_give_way_before_they_are_switched_off(mit_dog):
    drive = mit_dog.drive.model_copy(update={"profile": "tmotor-ak80-9-v1.1"})
    rig = Watched(mit_dog.model_copy(update={"drive": drive}))
    rig.stand()
    rig.pass_time(2.0)  # they have no watchdog, and hold what they were told last
    assert rig.height > 0.2
    rig.reconnect()
    rig.go(3.0)
    assert rig.height < 0.15
    assert rig.drop < GENTLE


class Bench:
    """The buses and the time of a rig, for a tool that only looks."""

    def __init__(self, rig):
        self._rig = rig
        self.buses = {"a": self}
        self.name = "a"

    def send(self, frame):
        self._rig.buses["a"].send(frame)

    def receive(self, wait):
        self._rig.sim.advance(0.002)
        self._rig.note()
        return self._rig.buses["a"].receive(0.0)

    def monotonic(self):
        return self._rig.sim.time


def test_a_tool_that_looks_at_a_held_dog_refuses_and_drops_nothing(dog, monkeypatch):
    rig = copy_of(watched, dog)
    rig.pass_time(0.5)
    bench = Bench(rig)
    monkeypatch.setattr(Cia402Drives, "configure", lambda _self: None)  # it is configured already
    with pytest.raises(LinkRefused, match="the drives hold the dog, and it would fall: lower it"):
        BenchSession(dog, bench.buses, bench)
    assert rig.states() == {DriveState.QUICK_STOP}
    assert rig.height > 0.2


# -- the way out -------------------------------------------------------------------------------------


class SimTime:
    """The simulated dog's time as a clock."""

    def __init__(self, sim):
        self._sim = sim

    def monotonic(self):
        return self._sim.time

    def time(self):
        return self._sim.time


class Leave:
    """An exchange whose host tells the dog to leave."""

    def __init__(self, rig):
        self._rig = rig

    def order(self):
        return Order(leave=True, alive=self._rig.sim.time, activity=self._rig.order.activity)

    def put(self, state):
        """Nobody reads it."""


def leave(rig, monkeypatch):
    """Run a loop that is told to leave to its end."""
    monkeypatch.setattr("fleet_quadruped.control.loop.realtime", lambda: False)
    loop = ControlLoop(rig.controller, rig.buses, Leave(rig), SimTime(rig.sim), moved=rig.sim.advance)
    monkeypatch.setattr(loop, "_pause", lambda _seconds: None)
    loop.run()


@pytest.mark.combinations
@pytest.mark.parametrize("loss", [0.0, 0.3])
@pytest.mark.parametrize("stands", [True, False])
def test_who_leaves_has_seen_every_drive_without_torque(any_dog, monkeypatch, loss, stands):
    rig = copy_of(stood_up if stands else Rig, any_dog)
    if loss:
        rig.sim.fault("loss", loss)
    leave(rig, monkeypatch)
    feedback = rig.controller.drives.feedback(rig.sim.time)
    assert {Power.DISABLED, Power.FAULT} >= set(feedback.powers)
    if any_dog.drive.protocol == "cia402":
        assert {DriveState.SWITCH_ON_DISABLED, DriveState.FAULT} >= {drive.state for drive in rig.sim.drives}
    assert all(motor.kp == motor.kd == 0 for motor in rig.sim.world.motors)


def test_a_drive_that_keeps_its_torque_is_reported(dog):
    rig = standing_dog(dog)
    rig.request(BodyRequest.SIT)
    while rig.mode is not BodyMode.SETTLING:
        rig.cycle()
    drive = rig.sim.drives[RL_HIP - 1]
    drive.hears = {frame: hears for frame, hears in drive.hears.items() if frame != 0x208}  # its RPDO
    rig.sim._listen()
    rig.go(2.0)
    assert health_of(rig.state(), 100).cause.startswith("RL_hip: the drive is enabled, wanted off")
