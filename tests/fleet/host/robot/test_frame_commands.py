"""Commands of a FrameAdapter: their frames are written step by step, and a stop ends what is left of them."""

import asyncio
import uuid
from typing import Literal

import pytest

from fleet.adapter import AdapterConfig, FrameAdapter, Until
from fleet.commands import command
from fleet.errors import LinkLost, NotReady, Refused, Unsupported
from fleet.host.robot.adapter_factory import capabilities
from fleet.host.robot.frame_commands import FrameCommands
from fleet.model.command import Command


class CartConfig(AdapterConfig):
    adapter: Literal["cart"] = "cart"
    link: str = "memory:cart"


class Cart(FrameAdapter[CartConfig]):
    """A robot whose reports are what the test says they are."""

    Config = CartConfig
    docked = bright = False

    def condition(self):
        return self.docked

    def drive(self, velocity):
        yield b"GO"

    def decode(self, frame, stamp):
        return ()

    def halt(self):
        yield b"STOP"

    def seen(self):
        return self.condition()

    @command("dock")
    def dock(self, *, bay: int):
        """Drive into a bay, and lock."""
        yield b"UNLOCK"
        yield b"DOCK %d" % {1: 1, 2: 2}[bay]
        yield Until(self.seen)
        yield b"LOCK"

    @command("lamp", moves=False)
    def lamp(self, *, level: int = 1):
        """Dim the lamp."""
        yield b"LAMP %d" % level
        yield Until(lambda: self.bright)
        yield b"OK"

    @command("nothing", moves=False)
    def nothing(self):
        """Be only a name."""
        return

    @command("odd")
    def odd(self):
        """Write a frame, then fail."""
        yield b"ODD"
        yield Until(lambda: self.docked)
        raise self.error


class Motion:
    """The motion of one link; the test stops it."""

    def __init__(self):
        self.turn = 7
        self.written = []

    def carry_out(self, frames, turn):
        if turn != self.turn:
            raise NotReady("the robot was stopped meanwhile")
        self.written.append(("moves", *frames))

    def stop(self):
        self.turn += 1


class Bench:
    """The commands of a cart on an open link."""

    def __init__(self):
        self.cart, self.motion = Cart(CartConfig(name="rex", twin=uuid.uuid4())), Motion()
        self.lost = ""
        self.commands = FrameCommands(self.cart, self.motion, self._write)
        self.specs = capabilities(Cart).commands

    @property
    def written(self):
        return self.motion.written

    def _write(self, frames):
        if self.lost:
            raise LinkLost(self.lost)
        self.written.append(("writes", *frames))

    def perform(self, name, **data):
        return self.commands.perform(self.specs[name], Command(name, data))

    async def begin(self, name, **data):
        """Begin a command that has to wait."""
        task = asyncio.ensure_future(self.perform(name, **data))
        await asyncio.sleep(0)
        return task

    async def seen(self):
        """Let a frame of the robot have been decoded."""
        self.commands.decoded()
        for _ in range(3):
            await asyncio.sleep(0)


@pytest.fixture
async def bench():
    return Bench()


async def test_a_command_that_moves_writes_its_frames_as_motion_and_the_rest_once_it_was_seen(bench):
    task = await bench.begin("dock", bay=2)
    assert bench.written == [("moves", b"UNLOCK", b"DOCK 2")]
    await bench.seen()
    assert not task.done()
    bench.cart.docked = True
    await bench.seen()
    assert task.done()
    assert bench.written[1:] == [("moves", b"LOCK")]


async def test_what_is_seen_already_is_not_waited_for(bench):
    bench.cart.docked = True
    await bench.perform("dock", bay=1)
    assert bench.written == [("moves", b"UNLOCK", b"DOCK 1"), ("moves", b"LOCK")]


async def test_a_stop_drops_the_frames_that_a_command_has_left(bench):
    task = await bench.begin("dock", bay=1)
    bench.motion.stop()
    bench.cart.docked = True
    await bench.seen()
    with pytest.raises(NotReady, match="the robot was stopped meanwhile"):
        await task
    assert bench.written == [("moves", b"UNLOCK", b"DOCK 1")]


async def test_a_command_without_motion_goes_on_through_a_stop(bench):
    task = await bench.begin("lamp", level=3)
    bench.motion.stop()
    bench.cart.bright = True
    await bench.seen()
    await task
    assert bench.written == [("writes", b"LAMP 3"), ("writes", b"OK")]


async def test_several_commands_wait_each_for_its_own(bench):
    dock, lamp = await bench.begin("dock", bay=1), await bench.begin("lamp")
    bench.cart.bright = True
    await bench.seen()
    assert (dock.done(), lamp.done()) == (False, True)
    bench.cart.docked = True
    await bench.seen()
    assert dock.done()


async def test_a_cancelled_command_waits_for_nothing_any_more(bench):
    task = await bench.begin("dock", bay=1)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    bench.cart.condition = None
    bench.commands.decoded()
    assert bench.written == [("moves", b"UNLOCK", b"DOCK 1")]


async def test_frames_that_come_before_the_command_goes_on_wake_it_once(bench):
    task = await bench.begin("dock", bay=1)
    bench.cart.docked = True
    bench.commands.decoded()
    bench.commands.decoded()
    await asyncio.wait_for(task, 20)


async def test_data_that_cannot_be_encoded_are_the_senders_error_and_nothing_is_written(bench, caplog):
    with pytest.raises(Refused, match=r"dock cannot be encoded: KeyError\(9\)") as error:
        await bench.perform("dock", bay=9)
    assert error.value.hint == "check its data"
    assert "rex: dock cannot be encoded" in caplog.text
    assert bench.written == []


@pytest.mark.parametrize("data", [{}, {"bay": "one"}, {"bay": 1, "door": 2}])
async def test_data_of_another_shape_are_refused(bench, data):
    with pytest.raises(Refused):
        await bench.perform("dock", **data)
    assert bench.written == []


async def test_a_command_that_yields_no_frames_is_refused(bench):
    with pytest.raises(Refused, match="nothing cannot be encoded: TypeError"):
        await bench.perform("nothing")


@pytest.mark.parametrize("error", [Unsupported("it has no lock"), NotReady("not now")])
async def test_what_the_adapter_says_of_a_command_reaches_its_sender(bench, error):
    bench.cart.error, bench.cart.docked = error, True
    with pytest.raises(type(error), match=str(error)):
        await bench.perform("odd")
    assert bench.written == [("moves", b"ODD")]


@pytest.mark.parametrize(
    "error", [ValueError("x"), LookupError("x"), ZeroDivisionError("x"), AttributeError("x")]
)
async def test_an_error_of_translation_later_on_is_a_refusal_too(bench, error):
    bench.cart.error, bench.cart.docked = error, True
    with pytest.raises(Refused, match="odd cannot be encoded"):
        await bench.perform("odd")


async def test_a_condition_that_fails_ends_its_command_and_no_other(bench):
    dock, lamp = await bench.begin("dock", bay=1), await bench.begin("lamp")
    bench.cart.condition = lambda: 1 // 0
    bench.cart.bright = True
    await bench.seen()
    with pytest.raises(ZeroDivisionError):
        await dock
    await asyncio.wait_for(lamp, 20)


async def test_a_link_that_is_lost_meanwhile_is_opened_again(bench):
    bench.lost = "no cable"
    with pytest.raises(NotReady, match="no cable") as error:
        await bench.perform("lamp")
    assert error.value.hint == "the link is being opened again"
