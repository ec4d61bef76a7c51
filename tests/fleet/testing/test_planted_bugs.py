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

    requested = False

    def tell(self):
        if not self.requested:
            self.requested = True
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


COMES_ONLINE = AdapterContract.test_it_comes_online_is_stopped_and_leaves_nothing_behind
MOVES = AdapterContract.test_it_moves_as_it_is_asked_and_stands_after_a_stop_and_a_halt
SHARES = AdapterContract.test_two_robots_share_no_state
COMMANDS = FrameContract.test_a_command_that_is_declared_not_to_move_it_does_not_move_it
HALTS = FrameContract.test_halt_is_never_empty_and_works_at_any_time
DECODES = FrameContract.test_decode_survives_whatever_arrives
NOISE = FrameContract.test_noise_on_its_link_ends_nothing_and_starts_nothing
OTHERS = FrameContract.test_one_robots_frames_do_not_change_another

# What the task names, in its order: each adapter, the test of the contract that finds it, and what it says.
# None: an assertion without words, since pytest does not rewrite the suite.
BUGS = {
    "blocks the loop": (
        (BlocksTheLoop, MOVES, "blocks the event loop for more than .* in tell"),
        (CartBlocksTheLoop, NOISE, "blocks the event loop for more than .* in decode"),
    ),
    "raises in stop": ((RaisesInStop, COMES_ONLINE, "'stop'"), (CartRaisesInStop, HALTS, "a bug")),
    "ignores stop": (
        (IgnoresStop, MOVES, "it moves after a stop"),
        (CartIgnoresStop, MOVES, "it moves after a stop"),
        (NeverEndsToStop, COMES_ONLINE, "stop does not return within"),
    ),
    "writes undeclared commands": (
        (MovesUnasked, MOVES, "it moves though nothing has requested motion"),
        (CartMovesUnasked, MOVES, "it moves though nothing has requested motion"),
        (CartMovesUnasked, NOISE, "it moves because of noise"),
        (CartHornMoves, COMMANDS, "horn says moves=False"),
    ),
    "no dead-man": (
        (HasNoDeadMan, MOVES, "it moves after a halt from another thread"),
        (CartHasNoDeadMan, MOVES, "it moves after a stop"),
        (NothingStopsIt, COMES_ONLINE, "nothing stops the robot when this process dies"),
    ),
    "crashes on cut bytes": (
        (CartCrashesOnCutBytes, DECODES, "list index out of range"),
        (CartCrashesOnCutBytes, NOISE, "closed"),
    ),
    "leaks a task": ((LeaksATask, COMES_ONLINE, "it leaves tasks behind: .* working"),),
    "shares state between instances": (
        (SharesState, SHARES, None),
        (CartSharesState, SHARES, None),
        (CartSharesAGlobal, OTHERS, None),
    ),
    "reports NaN": (
        (ReportsNotANumber, MOVES, "it reports what cannot be true"),
        (CartReportsNotANumber, DECODES, None),
    ),
    "wrong unit by 1000": (
        (ReportsMillivolts, MOVES, "it reports what cannot be true"),
        (ReportsMilliseconds, MOVES, "it reports what cannot be true"),
        (DrivesMillimetres, MOVES, r"asked for .*x=0\.39.*the robot does .*x=39\d\."),
        (TurnsTheOtherWay, MOVES, r"asked for .*yaw_rate=0\.3,.*the robot does .*yaw_rate=-0\.3,"),
        (CartReportsMillivolts, DECODES, None),
        (CartDrivesMetres, MOVES, "asked for .* the robot does "),
    ),
    "never comes online": ((ReportsNothing, COMES_ONLINE, "it never comes online"),),
}


def contract_of(adapter):
    """Return the contract of an adapter."""
    base = CartContract if issubclass(adapter, FrameAdapter) else RigContract
    return type("Contract", (base,), {"adapter": adapter})()


def failures(adapter):
    """Yield each test of the contract that an adapter fails, with what it says."""
    kept = contract_of(adapter)
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
    ("adapter", "test", "says"),
    [pytest.param(*row, id=f"{row[0].__name__}-{row[1].__name__}") for rows in BUGS.values() for row in rows],
)
def test_a_planted_bug_is_found_by_the_test_of_the_contract_that_is_meant_to(adapter, test, says):
    kinds = AssertionError if says is None else (Exception, pytest.fail.Exception)
    with pytest.raises(kinds, match=says):
        test(contract_of(adapter))


def test_every_planted_bug_is_in_the_table():
    planted = {each for base in (Rig, Cart) for each in base.__subclasses__() if each.__module__ == __name__}
    assert planted == {row[0] for rows in BUGS.values() for row in rows}
