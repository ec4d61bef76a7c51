"""The adapter with its body controller as a real process and a simulated dog in it."""

import asyncio
import os
import signal
import threading
import time
from types import SimpleNamespace

import pytest

from fleet import (
    BatteryReport,
    Level,
    LinkLost,
    LinkRefused,
    NotReady,
    PoseReport,
    Refused,
    Unsupported,
    Vector3,
    Velocity,
)
from fleet.model.report import ImuReport, JointReport, LogReport, MetricsReport, PhotoReport
from fleet.testing.robot import RecordingRobot, serve
from fleet_quadruped import QuadrupedAdapter, QuadrupedConfig
from fleet_quadruped.control.exchange import SharedValue, new_memory
from fleet_quadruped.control.orders import DogState, Order
from fleet_quadruped.robot.description import EXAMPLE

pytestmark = pytest.mark.real_time
TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"


def config():
    return QuadrupedConfig(name="rex", twin=TWIN, adapter="quadruped", link="sim:kinematic")


async def all_of(command):
    return [progress async for progress in command]


async def test_it_stands_walks_and_sits_down(running):
    async with running() as (adapter, robot, _):
        await all_of(adapter.stand_up())
        adapter.drive(Velocity(Vector3(0.4)))
        await robot.until(
            lambda: any(
                isinstance(report, PoseReport) and report.position.x > 0.2 for report in robot.reports
            )
        )
        await adapter.stop("arrived")
        await all_of(adapter.sit_down())
        await robot.until(
            lambda: {JointReport, ImuReport, BatteryReport, MetricsReport} <= set(map(type, robot.reports))
        )
    joints = robot.reports_of(JointReport)[0]
    assert list(joints.positions)[:3] == ["FL_abad", "FL_hip", "FL_knee"]
    assert len(joints.positions) == len(joints.velocities) == len(joints.efforts) == 12


@pytest.mark.parametrize("kind", ["self-walking", "self-walking-canopen"])
async def test_a_machine_that_walks_by_itself_takes_the_same_words(running, kind):
    async with running(link="sim:auto", body=EXAMPLE.with_name(f"{kind}.yaml")) as (adapter, robot, _):
        await all_of(adapter.stand_up())
        adapter.drive(Velocity(Vector3(0.4), 0.2))
        await robot.until(
            lambda: any(
                isinstance(report, PoseReport) and report.position.x > 0.1 for report in robot.reports
            )
        )
        await adapter.stop("there")
        await all_of(adapter.sit_down(delta_z=0.05))
        await adapter.battery_check()
        adapter.emergency_halt()
        await adapter._body.until(lambda: adapter._body.state.mode == "damped", "giving way")
        with pytest.raises(Refused, match="it is damped"):
            await all_of(adapter.stand_up())
        await adapter._body.until(lambda: adapter._body.state.mode == "off", "lying")
        await all_of(adapter.stand_up())


async def test_its_joints_are_led_in_joint_mode_alone_and_any_stop_leaves_it(running):
    async with running() as (adapter, robot, _):
        await all_of(adapter.stand_up())
        with pytest.raises(NotReady, match="standing"):
            adapter.move_joints({"FL_knee": 0.0})
        await all_of(adapter.joint_mode())
        low, high = (adapter.joint_ranges()["FL_knee"].least, adapter.joint_ranges()["FL_knee"].most)
        assert 0.0 < high - low <= 0.2 + 1e-6
        with pytest.raises(NotReady, match="posing"):
            adapter.drive(Velocity(Vector3(0.3)))

        def led():
            adapter.move_joints({"FL_knee": high})
            return robot.reports_of(JointReport)[-1].positions.get("FL_knee", 0.0) > low + 0.12

        await robot.until(led)
        await adapter.stop("a test")
        assert adapter._body.state.mode == "held"
        with pytest.raises(NotReady, match="held"):
            adapter.move_joints({"FL_knee": low})
        await all_of(adapter.stand_up())
        assert adapter._body.state.mode == "standing"
        await all_of(adapter.sit_down())


async def test_a_machine_that_walks_by_itself_has_no_joints_of_ours(running):
    async with running(link="sim:auto", body=EXAMPLE.with_name("self-walking.yaml")) as (adapter, _, _):
        assert adapter.joint_ranges() == {}
        with pytest.raises(Unsupported, match="by itself"):
            await all_of(adapter.joint_mode())


async def test_an_emergency_stop_damps_it_while_the_event_loop_is_stuck(running):
    async with running() as (adapter, _, _):
        await all_of(adapter.stand_up())
        adapter.drive(Velocity(Vector3(0.3)))
        thread = threading.Thread(target=adapter.emergency_halt)
        thread.start()
        thread.join()
        deadline = time.monotonic() + 5.0
        while (mode := adapter._body.process.states.get().mode) in {
            "standing",
            "walking",
        }:  # and never an await
            assert time.monotonic() < deadline
        assert mode == "damped"


async def test_a_halt_at_the_same_time_loses_no_emergency_stop():
    adapter, memory = QuadrupedAdapter(config(), RecordingRobot("rex")), new_memory()
    sent, seen = SharedValue(memory, Order), SharedValue(memory, Order)
    adapter._body.begin(SimpleNamespace(orders=sent, states=SimpleNamespace(get=DogState)), 0.005)
    threads = [threading.Thread(target=adapter.emergency_halt) for _ in range(20)]
    for thread in threads:
        thread.start()
        adapter.halt()
    for thread in threads:
        thread.join()
    assert adapter._body.order.stop == seen.get().stop == 20
    os.close(memory)


async def test_a_latched_fault_is_reported_as_one_until_it_is_reset(running):
    async with running(link="sim:kinematic?faults=overcurrent:8") as (adapter, robot, _):
        await robot.until(lambda: "RL_hip: over-current" in robot.healths[-1].cause)
        assert robot.healths[-1].level is Level.FAULT
        await robot.until(lambda: "frames: " in robot.healths[-1].cause)
        assert robot.healths[-1].cause.endswith(".log")
        with pytest.raises(Refused, match="send reset_faults"):
            await all_of(adapter.stand_up())
        await adapter.reset_faults()
        await robot.until(lambda: robot.healths[-1].level is Level.OK)


async def test_a_stop_has_not_ended_while_the_dog_still_rises(running):
    async with running(body=EXAMPLE) as (adapter, robot, _):
        rising = asyncio.create_task(all_of(adapter.stand_up()))
        await robot.until(lambda: adapter._body.state.mode == "rising")
        rising.cancel()
        await adapter.stop("asked")
        assert adapter._body.state.mode == "standing"


async def test_a_stop_is_not_answered_from_a_state_before_it():
    adapter = QuadrupedAdapter(config(), robot := RecordingRobot("rex"))
    shown = [DogState(stamp=robot.clock.monotonic(), mode="standing")]
    orders, states = SimpleNamespace(put=lambda _: None), SimpleNamespace(get=lambda: shown[-1])
    adapter._body.begin(SimpleNamespace(orders=orders, states=states), 0.005)
    adapter._body.poll()
    adapter.drive(Velocity(Vector3(0.4)))
    stopping = asyncio.create_task(adapter.stop("asked"))
    for mode, halted in [("standing", 0), ("walking", 0), ("walking", 1)]:
        shown.append(DogState(stamp=robot.clock.monotonic(), mode=mode, halted=halted))
        adapter._body.poll()
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert not stopping.done()
    shown.append(DogState(stamp=robot.clock.monotonic(), mode="standing", halted=1))
    adapter._body.poll()
    await stopping


async def test_a_stop_has_not_ended_while_an_emergency_stop_still_lowers_the_dog(running):
    async with running() as (adapter, robot, _):
        for reason in ("asked", "emergency_stop"):
            await all_of(adapter.stand_up())
            adapter.emergency_halt()
            with pytest.raises(NotReady, match="carrying out an emergency stop"):
                adapter.drive(Velocity(Vector3(0.3)))
            await robot.until(lambda: adapter._body.state.mode == "damped")
            await adapter.stop(reason)
            assert adapter._body.state.mode == "off"


async def test_a_stop_ends_a_recovery_where_the_dog_lies(running):
    async with running(body=EXAMPLE) as (adapter, robot, _):
        recovery = asyncio.create_task(all_of(adapter.recovery_stand()))
        await robot.until(lambda: adapter._body.state.mode == "recovering")
        recovery.cancel()
        await adapter.stop("asked")
        assert (adapter._body.state.mode, adapter._body.state.fault) == ("off", "")
        await all_of(adapter.stand_up())


async def test_an_emergency_stop_is_seen_to_be_obeyed(running):
    async with running() as (adapter, robot, _):
        await all_of(adapter.stand_up())
        adapter.drive(Velocity(Vector3(0.3)))
        await adapter.stop("emergency_stop")
        assert adapter._body.state.mode == "off"
        await all_of(adapter.sit_down())  # it lies already
        await robot.until(lambda: robot.healths[-1].cause == "emergency stop")


async def test_a_dog_that_lies_neither_walks_nor_changes_its_height_and_without_a_camera_takes_no_photo(
    running,
):
    async with running() as (adapter, robot, _):
        with pytest.raises(NotReady, match="stand_up first"):
            adapter.drive(Velocity(Vector3(0.3)))
        with pytest.raises(Unsupported, match="no camera"):
            await adapter.take_photo()
        with pytest.raises(Refused, match="stand up first"):
            await all_of(adapter.sit_down(delta_z=0.05))
        await all_of(adapter.stand_up())
        await all_of(adapter.sit_down(delta_z=0.05))
        await robot.until(lambda: adapter._body.state.height == pytest.approx(0.22, abs=0.005))


async def test_it_takes_a_photo_lights_its_lamp_and_tells_its_battery(running, tmp_path):
    (tmp_path / "shot.jpg").write_bytes(bytes.fromhex("ffd8ffc000110801e002800301110002110003110000"))
    async with running(camera=f"file:{tmp_path}/shot.jpg") as (adapter, robot, _):
        await adapter.take_photo()
        await adapter.led_toggle()
        await robot.until(lambda: bool(adapter._body.state.battery))
        await adapter.battery_check()
    photo = robot.reports_of(PhotoReport)[0]
    assert (photo.width, photo.height) == (640, 480)
    assert robot.reports_of(BatteryReport)[0].percent == 80


async def test_a_frozen_body_controller_is_reported_at_once_and_is_a_lost_link(running):
    async with running() as (adapter, robot, _):
        await all_of(adapter.stand_up())
        os.kill(adapter._body.process.pid, signal.SIGSTOP)
        await robot.until(lambda: robot.healths[-1].level is Level.OFFLINE)
        assert "the body controller is frozen" in robot.healths[-1].cause
        with pytest.raises(LinkLost, match="frozen"):
            adapter._body.poll()
        os.kill(adapter._body.process.pid, signal.SIGKILL)


async def test_a_signal_to_all_of_a_service_or_a_terminal_does_not_drop_the_dog(running):
    async with running() as (adapter, robot, _):
        await all_of(adapter.stand_up())
        for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP, signal.SIGINT):
            os.kill(adapter._body.process.pid, number)
        cycles = adapter._body.state.timing.cycles
        await robot.until(lambda: adapter._body.state.timing.cycles > cycles + 30)
        assert adapter._body.state.mode == "standing"


async def test_a_dog_sits_down_to_the_end_however_often_its_run_is_cancelled(running):
    async with running() as (adapter, _, run):
        await all_of(adapter.stand_up())
        process, states = adapter._body.process._process, adapter._body.process.states
        while not run.done():
            run.cancel()
            await asyncio.wait({run}, timeout=0.2)
    assert process.returncode == 0
    assert states.get().mode == "off"
    assert not states.get().capture  # told to leave is no fault that takes the place of a real one


async def test_a_drive_that_is_another_device_is_reported(running):
    with pytest.raises(LinkRefused, match="RL_knee"):
        async with running(link="sim:kinematic?faults=stranger:9"):
            pass


async def test_a_bus_that_cannot_be_opened_is_reported(running):
    with pytest.raises((LinkLost, LinkRefused), match="nowhere"):
        async with running(link=None, buses={"a": "can:slcan:/dev/nowhere"}):
            pass


@pytest.mark.parametrize("changes", [{"link": None}, {"buses": {"a": "can:virtual:x"}}, {"link": "sim:moon"}])
def test_a_dog_that_is_neither_real_nor_simulated_is_refused(changes):
    with pytest.raises(ValueError, match="sim:auto"):
        QuadrupedConfig(
            **{"name": "rex", "twin": TWIN, "adapter": "quadruped", "link": "sim:kinematic"} | changes
        )


async def test_a_killed_body_controller_is_a_lost_link_and_what_was_asked_is_not_done_again(running):
    async with running() as (adapter, robot, run):
        await all_of(adapter.stand_up())
        os.kill(adapter._body.process.pid, signal.SIGKILL)
        with pytest.raises(LinkLost, match="ended with status -9"):
            await run
        anew = type(adapter)(adapter.config, robot)
        again = asyncio.create_task(serve(anew))
        try:
            await robot.until(lambda: anew._body.state.timing.cycles > 50 and anew._body.state.mode == "off")
            assert (anew._body.state.answered, anew._body.state.fault) == (0, "")
        finally:
            again.cancel()
            await asyncio.gather(again, return_exceptions=True)
    messages = [report.message for report in robot.reports_of(LogReport)]
    assert messages == ["odometry was reset: position 0, 0 is where the dog is now"] * 2
