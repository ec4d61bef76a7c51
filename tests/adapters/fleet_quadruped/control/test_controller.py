"""One control cycle after the other: what is written to the drives, and what of them is told."""

import pytest

from fleet import CanFrame
from fleet.errors import LinkLost
from fleet_quadruped.body.measured import ZEROS
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.control.controller import Controller
from fleet_quadruped.drives.base import Power
from fleet_quadruped.safety.stages import BodyMode
from tests.adapters.fleet_quadruped.control.benches import START, Bench

RL_HIP = 7


@pytest.fixture
def bench(dog, monkeypatch):
    return Bench(dog, monkeypatch)


def test_nothing_is_written_before_each_drive_has_said_whether_it_holds_the_dog(bench):
    bench.drives.report(*range(11), age=0.0, power=Power.DISABLED)
    bench.drives.report(11, age=0.5)
    assert bench.cycle(150) == ["probe"] * 150
    assert not bench.controller.resting
    bench.drives.report(11, age=0.0, power=Power.DISABLED)
    assert bench.cycle(2) == ["disable"] * 2
    assert bench.controller.resting


@pytest.mark.parametrize("power", [Power.ENABLED, Power.STOPPING])
def test_a_dog_that_is_held_is_lowered_and_its_torque_taken_off_then(bench, power):
    bench.drives.report(age=0.0, power=Power.DISABLED)
    bench.drives.report(RL_HIP, power=power)
    lies = bench.dog.posture(bench.dog.poses.fold)
    assert bench.cycle() == ["lower"]
    assert bench.controller.targets == pytest.approx(lies, abs=0.01)  # from where its joints are
    assert not bench.controller.resting
    assert bench.state().warning == "it may have been held by its drives, and is lowered"
    assert bench.cycle(round(bench.dog.safety.damp_time / bench.dog.dt) + 2)[-1] == "disable"
    assert bench.state().warning == ""


@pytest.mark.parametrize(("age", "lost"), [(0.99, False), (1.01, True)])
def test_a_dog_at_rest_with_a_drive_that_is_silent_for_a_second_is_configured_again(bench, age, lost):
    bench.drives.report(age=0.0, power=Power.DISABLED)
    bench.cycle(101)
    bench.drives.report(RL_HIP, age=age)
    if lost:
        with pytest.raises(LinkLost, match=r"^RL_hip: id 8 on bus 'a' is silent; check its power$"):
            bench.cycle()
    else:
        bench.cycle()


def test_drives_have_a_second_from_the_start_to_be_heard(bench):
    bench.cycle(100)
    with pytest.raises(LinkLost, match="FL_abad: id 1"):
        bench.cycle(2)


def test_a_drive_at_rest_that_lost_its_configuration_ends_the_link(bench):
    bench.drives.report(age=0.0, power=Power.DISABLED)
    bench.cycle()
    bench.drives.report(RL_HIP, restarted=True, fault="id 8 has restarted")
    with pytest.raises(LinkLost, match=r"^RL_hip: id 8 has restarted$"):
        bench.cycle()


def test_a_fault_waits_for_its_reset_before_the_link_is_ended(bench):
    bench.stand()
    bench.drives.report(RL_HIP, power=Power.FAULT, fault="over-current")
    bench.cycle(2)
    assert bench.state().fault == "RL_hip: over-current"
    bench.drives.report(RL_HIP, restarted=True)
    bench.cycle(round(bench.dog.safety.damp_time / bench.dog.dt) + 5)
    assert bench.state().mode == "off"
    bench.request(BodyRequest.RESET)
    with pytest.raises(LinkLost):
        bench.cycle()


def test_while_it_is_lowered_only_a_whole_silent_bus_ends_the_link(bench):
    bench.stand()
    bench.tell(stop=1)
    bench.cycle()
    bench.drives.report(*range(11), age=1.01)
    bench.cycle()
    bench.drives.report(11, age=1.01)
    with pytest.raises(LinkLost, match=r"^bus 'a': all its drives are silent; their own stop holds them"):
        bench.cycle()


def test_a_drive_that_does_not_leave_its_quick_stop_is_named(bench):
    bench.stand()
    bench.drives.stubborn = "RL_hip"
    bench.tell(stop=1)
    held = bench.controller.targets
    bench.cycle(110)
    assert bench.state().fault.startswith("RL_hip: its drive does not leave quick stop: it is held")
    assert bench.controller.targets == pytest.approx(held, abs=0.01)


def test_a_bus_that_is_silent_while_the_dog_is_lowered_keeps_the_other_legs_from_folding(bench):
    bench.stand()
    bench.tell(stop=1)
    bench.cycle()
    held = bench.controller.targets
    bench.drives.report(age=0.2)
    bench.cycle(50)
    assert bench.state().mode == "damped"
    assert bench.controller.targets == pytest.approx(held, abs=0.01)


def test_a_velocity_ends_with_its_time_and_with_its_host(bench):
    bench.stand().tell(x=0.4, until=bench.now + 0.3)
    bench.cycle(30)
    assert bench.state().mode == "walking"
    bench.cycle(200)
    assert bench.state().mode == "standing"
    bench.tell(x=0.4, until=bench.now + 99.0)
    bench.alive = False
    bench.cycle(40)
    assert bench.state().mode == "walking"
    bench.cycle(150)
    assert bench.state().mode == "standing"
    bench.cycle(200)
    assert bench.state().mode == "off"


@pytest.mark.parametrize(
    ("until", "alive", "moves"), [(9.0, True, True), (0.0, True, False), (9.0, False, False)]
)
def test_joints_are_led_while_their_order_and_their_host_live(bench, until, alive, moves):
    bench.stand().request(BodyRequest.POSE)
    bench.alive = alive
    bench.now += 0.0 if alive else bench.dog.safety.deadman
    before = bench.controller.targets[2]
    bench.tell(joints=(None, None, before + 0.05), joints_until=bench.now + until)
    bench.cycle(50)
    assert (bench.controller.targets[2] - before > 0.01) == moves


def test_a_drive_that_cannot_be_enabled_refuses_the_request_in_its_words(bench):
    bench.drives.report(age=0.0, power=Power.DISABLED)
    bench.cycle()
    bench.drives.report(RL_HIP, power=Power.FAULT, fault="too hot")
    assert bench.request(BodyRequest.STAND) == "RL_hip: too hot; look at the dog, then send reset_faults"
    bench.drives.report(RL_HIP, power=Power.DISABLED, fault="", age=0.2)
    assert bench.request(BodyRequest.STAND) == "RL_hip: no feedback from id 8 on bus a"
    bench.drives.report(RL_HIP, age=0.0, temperature=120.0)
    assert bench.request(BodyRequest.STAND) == "RL_hip: 120 C, 85 is its limit"
    bench.drives.report(RL_HIP, temperature=40.0)
    assert bench.request(BodyRequest.STAND) == ""


def test_warm_joints_hold_its_speed_and_are_warned_of(bench):
    kind = bench.dog.all_joints[RL_HIP].kind
    half = (kind.temperature_warn + kind.temperature_max) / 2
    bench.drives.report(age=0.0, power=Power.DISABLED, temperature=half)
    bench.cycle()
    assert bench.controller.body.walker.speed_share == pytest.approx(0.5)
    assert bench.state().warning == "joints are warm: speed is held to 50%"


def test_a_controller_that_ends_leaves_what_it_does_not_know_alone(bench):
    bench.cycle()
    bench.drives.calls.clear()
    bench.controller.abandon()
    assert bench.drives.calls == []


def test_a_controller_that_ends_leaves_drives_that_are_off_off_and_others_damped(bench):
    bench.drives.report(age=0.0, power=Power.DISABLED)
    bench.cycle(2)
    bench.drives.calls.clear()
    bench.controller.abandon()
    assert bench.drives.calls == ["disable", "begin"]
    bench.stand()
    bench.drives.calls.clear()
    bench.controller.abandon()
    assert bench.drives.calls == [("damp", bench.dog.safety.kd), "begin"]


def test_a_state_has_the_time_of_each_measurement(bench):
    bench.drives.report(age=0.0, power=Power.DISABLED)
    bench.drives.report(RL_HIP, age=0.03)
    bench.cycle()
    looked = bench.now - bench.dog.dt
    state = bench.state()
    assert state.stamp == bench.now
    assert (state.measured[0], state.measured[RL_HIP]) == (looked, looked - 0.03)
    assert (state.posed, state.gyro, state.accel) == (looked - 0.03, None, None)
    assert bench.controller.oldest == 0.03
    assert (state.speeds, state.posture) == (ZEROS, ())
    assert state.loads.keys() == {"a"}


def test_torque_that_stays_on_for_a_second_is_a_fault_of_a_dog_that_is_off(bench):
    bench.stand().request(BodyRequest.SIT)
    bench.drives._are = lambda call, power: None
    while bench.controller.body.mode is not BodyMode.OFF:
        bench.cycle()
    bench.cycle(98)
    assert (bench.state().fault, bench.controller.resting) == ("", False)
    bench.cycle(5)
    assert bench.state().fault == "FL_abad: the drive is enabled, wanted off"
    assert (bench.state().mode, bench.controller.resting) == ("off", True)


def test_a_joint_is_compared_with_the_target_that_was_written_to_it(bench):
    bench.stand().tell(x=0.4, until=bench.now + 9.0)
    bench.drives.blocked.add(RL_HIP)
    bench.cycle(60)
    assert bench.state().fault.startswith("RL_hip: ")
    assert bench.state().mode == "damped"


def test_the_lamp_is_switched_with_the_order(bench):
    bench.drives.report(age=0.0, power=Power.DISABLED)
    bench.tell(lamp=True)
    bench.cycle(3)
    assert list(bench.bus.sent) == [CanFrame(0x121, bytes.fromhex("0164"))]


def test_a_frame_of_a_sensor_is_not_one_of_the_drives(dog, bench):
    controller = Controller(dog, {"a": bench.bus})
    for number in (0x110, 0x361, 0x188):
        controller.handle_frame("a", CanFrame(number, bytes(8)), START)
    assert bench.drives.taken == [("a", 0x188)]
    assert controller.addresses == bench.drives.addresses
    assert controller.complete()
