"""A vehicle that receives what a test says, recordings of real ones, and flights of simulated ones."""

import asyncio
import inspect
import itertools
import math
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet.link.memory import MemoryRobot
from fleet.testing.clock import JumpingLoop, ManualClock
from fleet.testing.operator import Operator
from fleet.testing.robot import LoopRobot, serve
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.codec import Parser
from fleet_mavlink.config import MavlinkConfig
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.sim.vehicle import SimVehicle
from fleet_mavlink.sim.wire import MavlinkWire
from fleet_mavlink.vehicle import Vehicle

RECORDINGS = Path(__file__).parents[2] / "data" / "mavlink"
TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"
AUTOPILOTS = {"ardupilot": 3, "px4": 12}
STEP = 0.05  # s; the longest step of the simulators


def framed(message, *, system=1, component=1):
    """Return a message as a foreign implementation frames it."""
    return bytes(message.pack(mav.MAVLink(None, srcSystem=system, srcComponent=component)))


def records(name):
    """Yield (seconds, frame) of a recording: 8 bytes of big-endian microseconds before each frame."""
    data = (RECORDINGS / f"{name}.tlog").read_bytes()
    at = 0
    while at < len(data):
        stamp = int.from_bytes(data[at : at + 8], "big") / 1e6
        begin = at + 8
        long = data[begin] == 0xFD
        signature = 13 if long and data[begin + 2] & 1 else 0
        at = begin + (12 if long else 8) + data[begin + 1] + signature
        yield stamp, data[begin:at]


def blank(kind):
    """Return a message of a class of pymavlink's, all zeros."""
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    values = [
        b"" if of == "char" else [0] * lengths[name] if lengths[name] else 0
        for name, of in zip(kind.fieldnames, kind.fieldtypes, strict=True)
    ]
    return kind(*values[: len(inspect.signature(kind).parameters)])


@pytest.fixture(scope="session")
def caches(tmp_path_factory):
    """Name a folder that is not there yet for each test; most of them never write into it."""
    return map(tmp_path_factory.mktemp("caches").joinpath, map(str, itertools.count()))


@pytest.fixture(autouse=True)
def own_cache(caches, monkeypatch):
    """Keep what vehicles serve out of the user's folders."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(next(caches)))


@pytest.fixture
def recording():
    return records


@pytest.fixture
def frame_of():
    return framed


@pytest.fixture
def blank_message():
    return blank


class VehicleHarness:
    """A vehicle on a clock of the test's own; ``sent`` is what was written to it."""

    def __init__(self, flavour="px4"):
        self.clock = ManualClock()
        self.sent = []
        self.vehicle = Vehicle(1, self.clock, lambda message, _address: self.sent.append(message))
        self._autopilot = AUTOPILOTS[flavour]

    def in_loop(self):
        """Let its clock be that of the running loop."""
        self.clock.monotonic = self.vehicle.now = asyncio.get_running_loop().time
        return self

    def beat(self, *, mode=0x03040000, armed=False, status=3, address=None, kind=2):
        """Let it beat once."""
        beat = Heartbeat(kind, self._autopilot, 0x80 if armed else 0, mode, status)
        self.vehicle.handle_message(beat, address)

    def receive(self, *messages):
        """Let it say something."""
        for message in messages:
            self.vehicle.handle_message(message, None)


@pytest.fixture
def harness():
    return VehicleHarness


class Answered(list):
    """What was sent; each message is answered 10 ms later with what a function returns for it."""

    def __init__(self, receive, answer):
        self._receive, self._answer, self._loop = receive, answer, asyncio.get_running_loop()

    def append(self, message):
        super().append(message)
        self._loop.call_later(0.01, lambda: self._receive(*self._answer(message)))

    def of(self, kind):
        return [each for each in self if type(each) is kind]


@pytest.fixture
def run_answered(run_in_sim_time, harness):
    """Run a test with a vehicle that beats, until ``it.silent``, and answers by a function."""

    def run(answer, test):
        async def main():
            it = harness("ardupilot").in_loop()
            it.sent, it.silent = Answered(it.receive, answer), False
            beating = asyncio.ensure_future(beats(it))
            await asyncio.sleep(0)
            await test(it)
            beating.cancel()

        run_in_sim_time(main())

    return run


async def beats(it):
    while True:
        if not it.silent:
            it.beat()
        await asyncio.sleep(0.5)


class SimFlight(Operator):
    """A simulated vehicle, and the adapter that flies it over a memory link."""

    def __init__(self, flavour, *, vehicle="multirotor", ready=0.0, faults=None, accessories=(), **config):
        self.sim = SimVehicle(flavour, vehicle=vehicle, ready_after=ready, faults=faults)
        self.wire = MavlinkWire(self.sim, accessories)
        self.commands = []  # every COMMAND_LONG and COMMAND_INT that was heard
        self.setpoints = []  # (time, SET_POSITION_TARGET_LOCAL_NED)
        self.order = []  # the command, or 0 for a setpoint, of all that was heard
        self.radio = True
        self.mute = False  # it hears, and is not heard
        self.deaf_to = set()  # kinds of messages that do not arrive
        self.ignored = []
        basics = {
            "failsafes": "ignore",
            "name": "kestrel",
            "twin": TWIN,
            "adapter": "mavlink",
            "link": f"memory:{id(self)}",
        }
        self.config = MavlinkConfig.model_validate(basics | config)
        self._peer = MemoryRobot(str(id(self)), self._heard)
        self._parser = mav.MAVLink(None)
        self._parser.robust_parsing = True

    async def __aenter__(self):
        self.robot = LoopRobot("kestrel", self.config.limits.over(MavlinkAdapter.limits))
        self.adapter = MavlinkAdapter(self.config, self.robot)
        self._origin = self.robot.clock.monotonic()
        self._peer.__enter__()
        self.run = asyncio.ensure_future(serve(self.adapter))
        self._turning = asyncio.ensure_future(self._turn())
        return self

    async def __aexit__(self, *_):
        self.robot.close()
        for task in (self.run, self._turning):
            task.cancel()
        await asyncio.gather(self.run, self._turning, return_exceptions=True)
        self._peer.__exit__(None, None, None)

    @property
    def now(self):
        return self.robot.clock.monotonic() - self._origin

    def _heard(self, data):
        for message in self._parser.parse_buffer(bytearray(data)) or ():
            if message.get_type() in {"COMMAND_LONG", "COMMAND_INT"}:
                self.commands.append(message)
                self.order.append(message.command)
            elif message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
                self.setpoints.append((self.now, message))
                self.order.append(0)
            if message.get_type() in self.deaf_to:
                self.ignored.append(message)
                return b""
        frames = self.wire.receive(data, self.now) if self.radio else []
        return b"" if self.mute else b"".join(frames)

    async def _turn(self):
        while True:
            frames = self.wire.step(self.now)
            if frames and self.radio and not self.mute:
                self._peer.say(b"".join(frames))
            await asyncio.sleep(STEP)

    def send_from_station(self, *messages):
        """Let another station, 255/190, say something to the vehicle."""
        for message in messages:
            self._peer.say(b"".join(self.wire.receive(framed(message, system=255, component=190), self.now)))

    @property
    def mode(self):
        return self.sim.pilot.mode.name

    @property
    def armed(self):
        return self.sim.pilot.armed

    @property
    def height(self):
        return -self.sim.body.down

    @property
    def place(self):
        """Return metres north and east of where it began, and up."""
        return self.sim.body.north, self.sim.body.east, self.height

    @property
    def speed(self):
        body = self.sim.body
        return math.hypot(body.vn, body.ve, body.vd)

    @property
    def state(self):
        return self.adapter._session.vehicle.state

    def requested(self, command):
        """Return what was asked by a command, in order."""
        return [each for each in self.commands if each.command == command]

    async def until(self, holds, within=120.0):
        """Let time pass until something holds; return the seconds it took."""
        began = self.now
        while not holds():
            assert self.now - began < within, f"not within {within} s"
            await asyncio.sleep(0.05)
        return self.now - began

    async def wait_until_known(self):
        """Let time pass until the adapter knows the vehicle and where it is."""
        await self.until(lambda: self.robot.is_connected and self.state.home_altitude is not None)
        return self


@pytest.fixture
def sim_flight():
    return SimFlight


@pytest.fixture
def run_in_sim_time():
    """Run a coroutine in a loop whose time jumps."""

    def run(main):
        with asyncio.Runner(loop_factory=JumpingLoop) as runner:
            return runner.run(main)

    return run


@pytest.fixture
def decoded():
    """Decode whole frames."""
    return lambda data: Parser().feed(data)
