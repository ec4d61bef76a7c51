import asyncio
import contextlib
import logging
import os
import pty
import select
import threading
import tty
from typing import Literal

import pytest

from fleet.adapter import AdapterConfig, FrameAdapter, Send, Until
from fleet.commands import command
from fleet.errors import Fault, LinkLost, LinkRefused, NotReady, Refused
from fleet.host.robot.adapter_factory import capabilities, create_adapter, start_command
from fleet.host.robot.frame_adapter_runner import FrameAdapterRunner
from fleet.link.memory import MemoryRobot
from fleet.link.url import open_link
from fleet.model.command import Command
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.model.health import Health, Level
from fleet.model.report import BatteryReport
from fleet.testing.robot import RecordingRobot, serve

SLOW, FAST = Velocity(Vector3(0.25)), Velocity(Vector3(1.0))
STOPS = [b"STOP\n"] * 5
BAYS = {1: 1, 2: 2}


class CartConfig(AdapterConfig):
    adapter: Literal["cart"] = "cart"
    link: str = "memory:cart"


class Cart(FrameAdapter[CartConfig]):
    """A robot for these tests."""

    Config = CartConfig
    during_encode = None

    def drive(self, velocity):
        if self.during_encode:
            self.during_encode()
        yield b"GO %.2f\n" % velocity.linear.x

    @command("dock")
    def dock(self, *, bay: int):
        """Drive into a bay."""
        if self.during_encode:
            self.during_encode()
        yield b"DOCK %d\n" % BAYS[bay]

    @command("lamp", moves=False)
    def lamp(self, *, level: int):
        """Dim the lamp."""
        yield b"LAMP %d\n" % level

    def decode(self, frame, stamp):
        if frame == b"PING":
            yield Send(b"PONG\n")
        elif frame.startswith(b"B"):
            yield BatteryReport(stamp, percent=float(frame[1:]))

    def halt(self):
        yield b"STOP\n"

    def hello(self):
        yield b"HELLO\n"

    def tick(self):
        yield b"POLL\n"


class Running:
    """A cart that is being run, the machine behind its link, and what the host was told."""

    def __init__(self, adapter, machine, robot):
        self.adapter, self.machine, self.robot = adapter, machine, robot
        self.run = asyncio.create_task(serve(adapter))

    def heard(self):
        heard, self.machine.heard[:] = list(self.machine.heard), []
        return heard

    def perform(self, name, **data):
        commands = capabilities(type(self.adapter.inner)).commands
        return start_command(self.adapter, commands[name], Command(name, data))

    async def outcome(self):
        async with asyncio.timeout(60):
            await asyncio.wait([self.run])
        return self.run.exception()


@pytest.fixture
async def running(request):
    async with run(Cart, request.node.name) as cart:
        yield cart


@contextlib.asynccontextmanager
async def run(plugin, name):
    robot = RecordingRobot()
    with MemoryRobot(name.replace("[", ".").rstrip("]")) as machine:
        adapter = create_adapter(plugin, config(f"memory:{machine.name}"), robot)
        cart = Running(adapter, machine, robot)
        await robot.until(lambda: robot.healths)
        assert cart.heard() == [b"HELLO\n"]
        yield cart
        cart.run.cancel()
        await asyncio.gather(cart.run, return_exceptions=True)


def config(link="memory:cart"):
    return CartConfig(name="cart", twin="6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f", link=link)


# -- the link -----------------------------------------------------------------------------------------


async def test_what_the_robot_says_is_cut_and_reported(running):
    running.machine.say(b"B8")
    running.machine.say(b"7\nrubbish\n")
    assert await running.robot.first(BatteryReport) == BatteryReport(running.robot.clock.time(), percent=87.0)


async def test_an_answer_is_written_at_once(running):
    running.machine.say(b"PING\nB1\n")
    await running.robot.first(BatteryReport)
    assert running.heard() == [b"PONG\n"]


async def test_the_robot_is_offline_until_it_is_understood(running):
    assert running.robot.healths[-1].level is Level.OFFLINE
    running.machine.say(b"rubbish\nB1\nB2\n")
    await running.robot.first(BatteryReport)
    assert running.robot.healths[1:] == [Health()]


async def test_a_robot_that_never_speaks_is_well_when_its_link_is_open():
    class Mute(Cart):
        silence = 0.0

    async with run(Mute, "mute") as cart:
        assert cart.robot.healths == [Health()]
        cart.robot.advance(100.0)


async def test_polls_are_written_on_time(running):
    running.robot.advance(2.5)
    assert running.heard() == [b"POLL\n", b"POLL\n"]


async def test_silence_counts_as_a_lost_link(running):
    running.robot.advance(2.0)
    running.machine.say(b"B1\n")
    await running.robot.first(BatteryReport)
    running.robot.advance(2.0)
    with pytest.raises(LinkLost, match="nothing received for 3"):
        running.robot.advance(2.0)


async def test_a_link_that_opens_slowly_is_not_silent(monkeypatch):
    async def open_slowly(*arguments):
        robot.advance(60.0)
        return await open_link(*arguments)

    monkeypatch.setattr("fleet.link.url.open_link", open_slowly)
    robot = RecordingRobot()
    with MemoryRobot("slow"):
        work = asyncio.create_task(serve(create_adapter(Cart, config("memory:slow"), robot)))
        await robot.until(lambda: robot.healths)
        robot.advance(2.0)
        work.cancel()
        await asyncio.gather(work, return_exceptions=True)


async def test_a_fallen_link_ends_the_run_with_the_reason(running):
    running.machine.unplug("the cable is out")
    error = await running.outcome()
    assert isinstance(error, LinkLost)
    assert "the cable is out" in str(error)


async def test_a_translation_that_raises_ends_the_run(running):
    running.machine.say(b"Bx\n")
    assert isinstance(await running.outcome(), ValueError)


async def test_a_translation_that_raises_what_no_future_takes_ends_the_run(running, monkeypatch):
    monkeypatch.setattr(running.adapter.inner, "decode", lambda frame, stamp: next(iter(())))
    running.machine.say(b"B50\n")
    error = await running.outcome()
    assert isinstance(error, RuntimeError)
    assert "StopIteration" in str(error)


async def test_whoever_leaves_writes_a_stop_first(running):
    running.adapter.drive(FAST)
    running.run.cancel()
    await asyncio.gather(running.run, return_exceptions=True)
    assert running.heard() == [b"GO 1.00\n", b"STOP\n"]


async def test_a_bad_link_is_refused_before_anything_is_opened():
    with pytest.raises(LinkRefused, match="begin it with"):
        create_adapter(Cart, config("rs232:1"), RecordingRobot())


async def test_a_listener_greets_the_first_speaker_and_ignores_strangers():
    robot, heard = RecordingRobot(), asyncio.Queue()
    adapter = FrameAdapterRunner(Cart(config("udpin:127.0.0.1:0")), robot)
    task = asyncio.create_task(serve(adapter))
    await robot.until(lambda: robot.healths)
    url = adapter._slot._link.url.replace("udpin", "udpout")
    machine = await open_link(url, lambda data, _: heard.put_nowait(data))
    stranger = await open_link(url, lambda data, _: heard.put_nowait(b"told a stranger " + data))
    machine.send(b"B1\n")
    async with asyncio.timeout(60):
        assert await heard.get() == b"HELLO\n"
        stranger.send(b"B2\n")
        machine.send(b"B3\n")
        await robot.until(lambda: len(robot.reports) == 2)
        assert [report.percent for report in robot.reports] == [1.0, 3.0]
        adapter.drive(SLOW)
        assert await heard.get() == b"GO 0.25\n"
        task.cancel()
        await asyncio.gather(task, machine.close(), stranger.close(), return_exceptions=True)


# -- motion -------------------------------------------------------------------------------------------


async def test_the_newest_velocity_is_repeated(running):
    running.adapter.drive(SLOW)
    running.adapter.drive(FAST)
    running.robot.advance(0.25)
    assert running.heard() == [b"GO 0.25\n", b"GO 1.00\n", b"GO 1.00\n", b"GO 1.00\n"]


async def test_standing_still_is_repeated_a_few_times_only(running):
    running.adapter.drive(FAST)
    running.adapter.drive(ZERO_VELOCITY)
    running.robot.advance(0.95)
    assert running.heard() == [b"GO 1.00\n"] + [b"GO 0.00\n"] * 6


async def test_a_stop_ends_the_repeating_and_is_repeated_a_few_times(running):
    running.adapter.drive(FAST)
    await running.adapter.stop("a test")
    running.robot.advance(0.95)
    assert running.heard() == [b"GO 1.00\n", b"STOP\n", *STOPS]


async def test_a_moving_command_ends_the_repeating(running):
    running.adapter.drive(FAST)
    await running.perform("dock", bay=2)
    running.robot.advance(0.95)
    assert running.heard() == [b"GO 1.00\n", b"DOCK 2\n"]


async def test_a_command_that_moves_nothing_leaves_the_velocity_alone(running):
    running.adapter.drive(FAST)
    await running.perform("lamp", level=3)
    running.robot.advance(0.15)
    assert running.heard() == [b"GO 1.00\n", b"LAMP 3\n", b"GO 1.00\n"]


async def test_a_halt_on_another_thread_is_written_while_the_loop_is_stuck(running):
    running.adapter.drive(FAST)
    thread = threading.Thread(target=running.adapter.halt)
    thread.start()
    thread.join()
    assert running.heard() == [b"GO 1.00\n", b"STOP\n"]


async def test_a_stop_of_a_robot_that_is_not_heard_is_written_or_it_says_that_it_is_not(running):
    assert running.adapter.halt_unheard("stop")
    assert running.heard() == [b"STOP\n"]
    running.machine.unplug()
    with pytest.raises(LinkLost, match="accepts no data"):
        running.adapter.halt_unheard("stop")
    with pytest.raises(LinkLost, match="accepts no data"):
        await running.adapter.stop("stop")


class SlowLine:
    """A pseudo-terminal that carries a byte in 10 ms, and the robot's end of it."""

    def __init__(self, machine, device):
        tty.setraw(device)
        self.machine, self.link = machine, f"serial:{os.ttyname(device)}?baud=1000"

    def heard(self, last):
        """Return all that has come, up to what must come last."""
        said = b""
        while not said.endswith(last):
            assert select.select([self.machine], [], [], 60)[0], said
            said += os.read(self.machine, 100)
        return said


@pytest.fixture
def slow_line():
    ends = pty.openpty()
    yield SlowLine(*ends)
    for end in ends:
        os.close(end)


async def test_of_many_motions_on_a_slow_line_only_the_newest_waits(slow_line, caplog):
    robot = RecordingRobot()
    adapter = create_adapter(Cart, config(slow_line.link), robot)
    task = asyncio.create_task(serve(adapter))
    await robot.until(lambda: robot.healths)
    robot.advance(0.2)
    for tenth in range(20):
        adapter.drive(Velocity(Vector3(tenth / 10)))
    assert slow_line.heard(b"GO 0.10\n") == b"HELLO\nGO 0.00\nGO 0.10\n"
    robot.advance(0.1)
    assert slow_line.heard(b"GO 1.90\n") == b"GO 1.90\n"
    adapter.drive(SLOW)
    adapter.drive(FAST)
    adapter.halt()
    robot.advance(1.0)
    assert slow_line.heard(b"POLL\n").count(b"GO") <= 1
    assert "only the newest" in caplog.text
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


async def test_a_velocity_decided_before_a_halt_is_not_written_after_it(running):
    running.adapter.inner.during_encode = running.adapter.halt
    with pytest.raises(NotReady, match="stopped meanwhile"):
        running.adapter.drive(FAST)
    running.adapter.inner.during_encode = None
    running.robot.advance(0.95)
    assert running.heard() == [b"STOP\n", *STOPS]


async def test_a_repeat_decided_before_a_halt_is_not_written_after_it(running):
    running.adapter.drive(FAST)
    running.adapter.inner.during_encode = running.adapter.halt
    running.robot.advance(0.1)
    assert running.heard() == [b"GO 1.00\n", b"STOP\n"]


def broken_halt():
    raise RuntimeError("a bug")


BROKEN = r"halt\(\) raised RuntimeError: a bug; the frames of its start were written"


async def test_a_halt_that_raises_is_replaced_by_the_first_one_and_fails(running):
    running.adapter.inner.halt = broken_halt
    with pytest.raises(RuntimeError, match=BROKEN):
        running.adapter.halt()
    with pytest.raises(RuntimeError, match=BROKEN):
        await running.adapter.stop("stop")
    assert running.heard() == [b"STOP\n"] * 2


async def test_a_halt_that_raises_is_logged_once_however_often_it_is_repeated(running, caplog):
    running.adapter.inner.halt = broken_halt
    assert running.adapter.halt_unheard("stop")
    running.robot.advance(1.0)
    assert running.heard().count(b"STOP\n") == 6
    assert caplog.text.count("the frames of its start are used") == 1
    assert "Traceback" not in caplog.text


async def test_a_halt_that_works_again_is_written_as_it_is(running):
    running.adapter.inner.halt = broken_halt
    assert running.adapter.halt_unheard("stop")
    running.adapter.inner.halt = lambda: [b"HALT\n"]
    running.adapter.halt()
    assert running.heard() == [b"STOP\n", b"HALT\n"]


async def test_a_robot_that_cannot_be_halted_is_not_run():
    class Runaway(Cart):
        def halt(self):
            return ()

    with pytest.raises(Fault, match="must be stoppable"):
        create_adapter(Runaway, config(), RecordingRobot())


async def test_motion_over_a_fallen_link_is_not_ready(running):
    running.machine.unplug("the cable is out")
    with pytest.raises(NotReady, match="the cable is out"):
        running.adapter.drive(FAST)


# -- commands -----------------------------------------------------------------------------------------


async def test_data_that_cannot_be_encoded_is_refused_not_a_crash(running, caplog):
    caplog.set_level(logging.WARNING)
    with pytest.raises(Refused, match="dock cannot be encoded: KeyError"):
        await running.perform("dock", bay=7)
    assert not running.run.done()


async def test_parameters_of_a_declared_method_are_checked(running):
    with pytest.raises(Refused, match="did you mean 'level'"):
        await running.perform("lamp", levle=1)
    with pytest.raises(Refused, match="must be a whole number, not text"):
        await running.perform("lamp", level="high")


async def test_a_command_that_moves_nothing_needs_a_link_too(running):
    running.machine.unplug("the cable is out")
    with pytest.raises(NotReady, match="the cable is out"):
        await running.perform("lamp", level=1)


async def test_a_command_decided_before_a_halt_is_not_written_after_it(running):
    running.adapter.inner.during_encode = running.adapter.halt
    with pytest.raises(NotReady, match="stopped meanwhile"):
        await running.perform("dock", bay=1)
    assert running.heard() == [b"STOP\n"]


# -- what was seen ------------------------------------------------------------------------------------


class Gripper(Cart):
    """A cart with a gripper that says where it is, and how it feels."""

    position = ""

    @command("grip")
    def grip(self, *, hard: bool = False):
        """Close the gripper, then hold it."""
        yield b"CLOSE\n"
        yield Until(lambda: self.position == "closed")
        yield b"HOLD\n"
        yield Until(lambda: {"held": True, "closed": False}[self.position])

    def decode(self, frame, stamp):
        if frame.startswith(b"AT "):
            self.position = frame[3:].decode()
        elif frame == b"HOT":
            yield Health(Level.FAULT, "its motor is too hot: let it cool")
        elif frame == b"COOL":
            yield Health()


@pytest.fixture
async def gripper(request):
    async with run(Gripper, request.node.name) as cart:
        yield cart


async def says(cart, *frames):
    for frame in frames:
        cart.machine.say(frame + b"\n")
    await asyncio.sleep(0)
    await asyncio.sleep(0)


async def test_a_command_is_done_when_the_robot_was_seen_to_have_done_it(gripper):
    gripping = asyncio.ensure_future(gripper.perform("grip"))
    await says(gripper, b"AT open")
    assert gripper.heard() == [b"CLOSE\n"]
    await says(gripper, b"AT closed")
    assert gripper.heard() == [b"HOLD\n"]
    assert not gripping.done()
    await says(gripper, b"AT held")
    await asyncio.wait_for(gripping, 60)


async def test_what_was_seen_before_is_not_waited_for(gripper):
    await says(gripper, b"AT closed")
    gripping = asyncio.ensure_future(gripper.perform("grip"))
    await says(gripper)
    assert gripper.heard() == [b"CLOSE\n", b"HOLD\n"]
    gripping.cancel()


async def test_a_halt_while_a_command_waits_lets_none_of_its_frames_follow(gripper):
    gripping = asyncio.ensure_future(gripper.perform("grip"))
    await says(gripper, b"AT open")
    gripper.adapter.halt()
    await says(gripper, b"AT closed")
    with pytest.raises(NotReady, match="stopped meanwhile"):
        await gripping
    assert gripper.heard() == [b"CLOSE\n", b"STOP\n"]


async def test_an_until_that_raises_fails_its_command_and_nothing_else(gripper):
    gripping = asyncio.ensure_future(gripper.perform("grip"))
    await says(gripper, b"AT closed", b"AT lost")
    with pytest.raises(KeyError):
        await gripping
    assert not gripper.run.done()


async def test_a_health_that_the_robot_says_counts_until_the_next(gripper):
    await says(gripper, b"HOT", b"AT open")
    assert gripper.robot.healths[-1] == Health(Level.FAULT, "its motor is too hot: let it cool")
    await says(gripper, b"COOL")
    assert gripper.robot.healths[-1] == Health()
