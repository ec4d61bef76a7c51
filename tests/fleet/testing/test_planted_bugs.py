"""The contract suite finds planted bugs: it fails each of these adapters and passes the right twins."""

import asyncio
import contextlib
import math
import re
import time
from typing import Annotated, Literal

import pytest
from pydantic import Field

from fleet import Adapter, AdapterConfig, FrameAdapter, Limits, Range, Vector3, Velocity, command
from fleet.link.url import LinkText
from fleet.model.geometry import ZERO_VELOCITY
from fleet.model.report import BatteryReport
from fleet.testing.clock import JumpingLoop
from fleet.testing.contract import AdapterContract, FrameContract

# -- the right twins -----------------------------------------------------------------------------------


class RigConfig(AdapterConfig):
    adapter: Literal["rig"]


class Machine:
    """The far end of a vendor's SDK."""

    def __init__(self):
        self.velocity = ZERO_VELOCITY

    def move(self, x, turn):
        self.velocity = Velocity(Vector3(x), turn)


class Rig(Adapter[RigConfig]):
    """A robot behind an SDK, which is told its velocity again and again."""

    Config = RigConfig
    limits = Limits(speed=1.2, yaw_rate=0.9)
    failsafe = "it stops 0.5 s after the last velocity"
    machine = None  # the test's

    async def connect(self):
        self.held = ZERO_VELOCITY
        self.robot.every(0.1, self.keep)
        self.robot.every(0.2, self.tell)

    def keep(self):
        self.machine.move(self.held.linear.x, self.held.yaw_rate)

    def tell(self):
        self.robot.report(BatteryReport(self.robot.clock.time(), percent=80.0, voltage=24.1))

    def drive(self, velocity):
        self.held = velocity
        self.keep()

    async def stop(self, reason):
        self.halt()

    def halt(self):
        self.held = ZERO_VELOCITY
        self.machine.move(0.0, 0.0)


class RigContract(AdapterContract):
    adapter = Rig
    config = {"adapter": "rig"}
    settles = 0.6

    @contextlib.asynccontextmanager
    async def robot_side(self):
        self.machine = Machine()
        self.adapter.machine = property(lambda _: self.machine)
        yield {}

    def velocity(self, bench):
        return self.machine.velocity


class CartConfig(AdapterConfig):
    adapter: Literal["cart"]
    link: LinkText = Field("memory:cart", description="Where it is.")


class Cart(FrameAdapter[CartConfig]):
    """A robot that speaks lines: told ``M mm/s mrad/s``, it says ``B mV percent``."""

    Config = CartConfig
    limits = Limits(speed=1.2, yaw_rate=0.9)
    failsafe = "it stops 0.5 s after the last velocity"

    def drive(self, velocity):
        x, turn = (min(max(each, -9.0), 9.0) for each in (velocity.linear.x, velocity.yaw_rate))
        yield b"M %d %d\n" % (round(x * 1000), round(turn * 1000))

    def decode(self, frame, stamp):
        if match := re.fullmatch(rb"B (\d{1,5}) (\d{1,2})", frame):
            yield BatteryReport(stamp, voltage=int(match[1]) / 1000, percent=float(match[2]))

    def halt(self):
        yield b"M 0 0\n"

    def tick(self):
        yield b"?\n"

    @command("horn", moves=False)
    def horn(self, *, seconds: Annotated[float, Range(0.1, 5, "s")]):
        """Sound the horn."""
        yield b"H %d\n" % round(seconds * 10)


class CartContract(FrameContract):
    adapter = Cart
    config = {"adapter": "cart"}
    said = (b"B 24100 80\n",)

    def velocity_of(self, frame):
        match = re.fullmatch(rb"M (-?\d+) (-?\d+)\n", frame)
        return match and Velocity(Vector3(int(match[1]) / 1000), int(match[2]) / 1000)


# -- the ten bugs --------------------------------------------------------------------------------------


HANGS = 1.5  # s; on a busy computer a part of it does not count as anybody's fault


async def working():
    await asyncio.Event().wait()


class BlocksTheLoop(Rig):
    """Asks its SDK on the event loop, and waits long for the first answer."""

    asked = False

    def tell(self):
        if not self.asked:
            self.asked = True
            time.sleep(HANGS)
        super().tell()


class RaisesInStop(Rig):
    """Fails when it is stopped."""

    async def stop(self, reason):
        raise KeyError(reason)


class IgnoresStop(Rig):
    """Does not stop."""

    async def stop(self, reason):
        """Think about it."""


class NeverEndsToStop(Rig):
    """Waits for something that never comes."""

    async def stop(self, reason):
        self.halt()
        await working()


class MovesUnasked(Rig):
    """Turns to find its bearings once it is connected."""

    async def connect(self):
        await super().connect()
        self.held = Velocity(yaw_rate=0.3)


class HasNoDeadMan(Rig):
    """Goes on repeating its velocity after the dead-man has halted it."""

    def halt(self):
        self.machine.move(0.0, 0.0)

    async def stop(self, reason):
        self.held = ZERO_VELOCITY
        self.halt()


class NothingStopsIt(Rig):
    """Has no fail-safe, and leaves no halt."""

    failsafe = ""


class LeaksATask(Rig):
    """Begins a task and forgets it."""

    async def connect(self):
        await super().connect()
        type(self).tasks = frozenset({asyncio.create_task(working())})


class SharesState(Rig):
    """Keeps what each robot said in one list for all."""

    said = []

    def tell(self):
        super().tell()
        self.said.append(self.config.name)


class ReportsNothing(Rig):
    """Connects to nothing and never says a word."""

    connect = Adapter.connect
    held = ZERO_VELOCITY


class ReportsNotANumber(Rig):
    """Reports what it does not know."""

    def tell(self):
        self.robot.report(BatteryReport(self.robot.clock.time(), percent=math.nan))


class ReportsMillivolts(Rig):
    """Reports mV as V."""

    def tell(self):
        self.robot.report(BatteryReport(self.robot.clock.time(), voltage=24_100.0))


class ReportsMilliseconds(Rig):
    """Stamps in ms."""

    def tell(self):
        self.robot.report(BatteryReport(self.robot.clock.time() * 1000, percent=80.0))


class DrivesMillimetres(Rig):
    """Tells m/s to a machine that counts in mm/s, so to speak."""

    def keep(self):
        self.machine.move(self.held.linear.x * 1000, self.held.yaw_rate)


class TurnsTheOtherWay(Rig):
    """Counts angles clockwise."""

    def keep(self):
        self.machine.move(self.held.linear.x, -self.held.yaw_rate)


class CartBlocksTheLoop(Cart):
    """Thinks long about the first line."""

    thought = False

    def decode(self, frame, stamp):
        if not self.thought:
            self.thought = True
            time.sleep(HANGS)
        return super().decode(frame, stamp)


class CartRaisesInStop(Cart):
    """Fails when it is halted."""

    def halt(self):
        raise RuntimeError("a bug")


class CartIgnoresStop(Cart):
    """Asks instead of stopping."""

    def halt(self):
        yield b"?\n"


class CartMovesUnasked(Cart):
    """Writes a velocity as its keep-alive."""

    def tick(self):
        yield b"M 100 0\n"


class CartHornMoves(Cart):
    """Has a command that moves though it says that it does not."""

    @command("horn", moves=False)
    def horn(self, *, seconds: Annotated[float, Range(0.1, 5, "s")]):
        """Sound the horn, on the run."""
        yield b"M 500 0\n"


class CartHasNoDeadMan(Cart):
    """Remembers its velocity and writes it again."""

    last = b"M 0 0\n"

    def drive(self, velocity):
        for frame in super().drive(velocity):
            self.last = frame
            yield frame

    def tick(self):
        yield self.last


class CartCrashesOnCutBytes(Cart):
    """Believes that every line is whole."""

    def decode(self, frame, stamp):
        yield BatteryReport(stamp, voltage=int(frame.split()[1]) / 1000)


class CartSharesState(Cart):
    """Remembers the newest velocity of all carts."""

    newest = {"frame": b"M 0 0\n"}

    def drive(self, velocity):
        self.newest["frame"] = next(iter(super().drive(velocity)))
        yield self.newest["frame"]

    def halt(self):
        yield b"M 0 0\n"


NEWEST = [b"?\n"]


class CartSharesAGlobal(Cart):
    """The same, in its module."""

    def drive(self, velocity):
        NEWEST[0] = next(iter(super().drive(velocity)))
        yield NEWEST[0]

    def tick(self):
        yield NEWEST[0]


class CartReportsNotANumber(Cart):
    """Reports what it does not know."""

    def decode(self, frame, stamp):
        yield BatteryReport(stamp, voltage=math.nan)


class CartReportsMillivolts(Cart):
    """Reports mV as V."""

    def decode(self, frame, stamp):
        for report in super().decode(frame, stamp):
            yield BatteryReport(stamp, voltage=report.voltage * 1000)


class CartDrivesMetres(Cart):
    """Tells m/s to a robot that counts in mm/s."""

    def drive(self, velocity):
        yield b"M %d %d\n" % (round(velocity.linear.x), round(velocity.yaw_rate))


# What the task names, in its order, each with the adapters that have it.
BUGS = {
    "blocks the loop": (BlocksTheLoop, CartBlocksTheLoop),
    "raises in stop": (RaisesInStop, CartRaisesInStop),
    "ignores stop": (IgnoresStop, CartIgnoresStop, NeverEndsToStop),
    "writes undeclared commands": (MovesUnasked, CartMovesUnasked, CartHornMoves),
    "no dead-man": (HasNoDeadMan, CartHasNoDeadMan, NothingStopsIt),
    "crashes on cut bytes": (CartCrashesOnCutBytes,),
    "leaks a task": (LeaksATask,),
    "shares state between instances": (SharesState, CartSharesState, CartSharesAGlobal),
    "reports NaN": (ReportsNotANumber, CartReportsNotANumber),
    "wrong unit by 1000": (
        *(ReportsMillivolts, ReportsMilliseconds, DrivesMillimetres, TurnsTheOtherWay),
        *(CartReportsMillivolts, CartDrivesMetres),
    ),
    "never comes online": (ReportsNothing,),
}


def failures(adapter):
    """Yield each test of the contract that an adapter fails, with what it says."""
    base = CartContract if issubclass(adapter, FrameAdapter) else RigContract
    kept = type("Contract", (base,), {"adapter": adapter})()
    for name in sorted(name for name in dir(kept) if name.startswith("test_")):
        try:
            getattr(kept, name)()
        except (Exception, pytest.fail.Exception) as error:  # noqa: BLE001 - whatever the suite raises
            yield name, str(error)


def run_in_simulated_time(main):
    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        return runner.run(main)


@pytest.fixture(autouse=True)
def quickly(monkeypatch):
    """Let nobody wait for what never comes."""
    NEWEST[:] = [b"?\n"]
    monkeypatch.setattr(asyncio, "run", run_in_simulated_time)


@pytest.mark.parametrize("adapter", [Rig, Cart])
def test_the_suite_passes_an_adapter_that_is_right(adapter):
    assert list(failures(adapter)) == []


@pytest.mark.parametrize(
    ("bug", "adapter"), [(bug, adapter) for bug, adapters in BUGS.items() for adapter in adapters]
)
def test_the_suite_fails_an_adapter_with_a_planted_bug(bug, adapter):
    assert next(failures(adapter), None), bug
