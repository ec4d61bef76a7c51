"""A bench: one simulated vehicle, its own time, and the words of a ground station."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.params import encode
from fleet_mavlink.sim.vehicle import SimVehicle
from tests.adapters.fleet_mavlink.sim.mission_plans import plan, upload

NAN = math.nan
HOME = (47.397742, 8.545594, 488.0, 0.0)
STEP = 0.05  # s; the longest step of the simulators


class Bench:
    """Moves a vehicle in steps of ``step`` s and keeps what it says, each message once a step at most."""

    def __init__(self, flavour: str, *, step: float = STEP, **setup: Any) -> None:
        setup.setdefault("ready_after", 0.0)
        setup.setdefault("home", HOME)
        self.vehicle = SimVehicle(flavour, **setup)
        self.ardupilot = flavour == "ardupilot"
        self.now = 0.0
        self._step = step
        self._beats = round(1.0 / step)  # steps between heartbeats of the ground station
        self.heard: list[Any] = []
        self.gcs = True

    @property
    def body(self) -> Any:
        return self.vehicle.body

    @property
    def pilot(self) -> Any:
        return self.vehicle.pilot

    @property
    def mode(self) -> str:
        return self.pilot.mode.name

    @property
    def height(self) -> float:
        return -self.body.down

    def tell(self, message: Any, *, system: int = 255, component: int = 190) -> list[Any]:
        """Send a message; return what is answered at once."""
        message._header = mav.MAVLink_header(message.id, srcSystem=system, srcComponent=component)
        answers = self.vehicle.handle(message, self.now)
        self.heard += answers
        return answers

    def run(self, seconds: float) -> None:
        """Let time pass, with a ground station's heartbeat every second."""
        for _ in range(round(seconds / self._step)):
            if self.gcs and self._steps_since_heartbeat() == 0:
                self.tell(mav.MAVLink_heartbeat_message(mav.MAV_TYPE_GCS, 8, 0, 0, 0, 3))
            self.now += self._step
            self.heard += self.vehicle.step(self.now)

    def _steps_since_heartbeat(self) -> int:
        """Return the steps since a heartbeat of the ground station was due."""
        return round(self.now / self._step) % self._beats

    def lose_station(self) -> None:
        """Let the ground station be silent after its next heartbeat."""
        while self._steps_since_heartbeat() != 1:
            self.run(self._step)
        self.gcs = False

    def until(self, happened: Callable[[], bool], limit: float = 60.0) -> float:
        """Let time pass until something happened; return how long it took."""
        began = self.now
        while not happened():
            assert self.now - began < limit, f"not within {limit} s"
            self.run(0.1)
        return self.now - began

    def requests(self, command: int, *params: float) -> list[int]:
        """Send COMMAND_LONG; return the results of its acknowledgements."""
        values = [*params, *([0.0] * (7 - len(params)))]
        return self._results(mav.MAVLink_command_long_message(1, 1, command, 0, *values))

    def requests_int(self, command: int, frame: int, p: tuple[float, ...], *place: float) -> list[int]:
        """Send COMMAND_INT with degrees and metres; return the results of its acknowledgements."""
        latitude, longitude, altitude = place
        scaled = (int(latitude * 1e7), int(longitude * 1e7), altitude)
        return self._results(mav.MAVLink_command_int_message(1, 1, frame, command, 0, 0, *p, *scaled))

    def _results(self, message: Any) -> list[int]:
        before = len(self.heard)
        self.tell(message)
        self.run(2 * self._step)
        return [
            m.result
            for m in self.heard[before:]
            if m.get_type() == "COMMAND_ACK" and m.command == message.command
        ]

    def drive(
        self, vx: float, vy: float, vz: float, *, frame: int = 8, mask: int = 0x5C7, **more: float
    ) -> None:
        """Send one velocity setpoint."""
        yaw, rate = more.get("yaw", 0.0), more.get("rate", 0.0)
        self.tell(
            mav.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, frame, mask, *(0.0, 0.0, 0.0), vx, vy, vz, *(0.0, 0.0, 0.0), yaw, rate
            )
        )

    def stream(self, seconds: float, vx: float, vy: float = 0.0, vz: float = 0.0, **more: Any) -> None:
        """Send a velocity at 10 Hz."""
        for _ in range(round(seconds * 10)):
            self.drive(vx, vy, vz, **more)
            self.run(0.1)

    def said(self, kind: str) -> list[Any]:
        """Return the messages of a kind, oldest first."""
        return [message for message in self.heard if message.get_type() == kind]

    def last(self, kind: str) -> Any:
        return self.said(kind)[-1]

    @property
    def texts(self) -> list[str]:
        """What STATUSTEXT said, chunks joined."""
        found: list[str] = []
        for message in self.said("STATUSTEXT"):
            if message.chunk_seq:
                found[-1] += message.text
            else:
                found.append(message.text)
        return found

    def set_mode(self, name: str) -> list[int]:
        """Ask for a mode of this vehicle by its name."""
        custom = self.pilot.modes[name].custom
        if self.ardupilot:
            return self.requests(176, 1, custom)
        return self.requests(176, 1, custom >> 16 & 0xFF, custom >> 24)

    def climb(self, height: float = 10.0) -> None:
        """Take off and wait at the height."""
        self.run(0.2)
        if self.ardupilot:
            self.set_mode("GUIDED")
            assert self.requests(400, 1) == [0]
            assert self.requests(22, 0, 0, 0, 0, 0, 0, height) == [0]
        else:
            assert self.requests(22, NAN, 0, 0, NAN, NAN, NAN, HOME[2] + height) == [0]
            assert self.requests(400, 1) == [0]
        self.until(lambda: abs(self.height - height) < 0.2)
        self.run(2.0)

    def set_param(self, name: str, value: float) -> None:
        """Send PARAM_SET as this autopilot encodes values."""
        (known,) = self.tell(mav.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
        sensors = encode(known.param_type, value, "cast" if self.ardupilot else "bytewise")
        self.tell(mav.MAVLink_param_set_message(1, 1, name.encode(), sensors, known.param_type))


@pytest.fixture(scope="session")
def bench() -> Callable[..., Bench]:
    """Make a bench: ``bench("px4", ready_after=4.6, faults={...})``."""
    return Bench


@pytest.fixture
def px4(bench: Callable[..., Bench]) -> Bench:
    """Make a PX4 multirotor on the ground."""
    return bench("px4")


@pytest.fixture
def flying(px4: Bench) -> Bench:
    """Let a PX4 multirotor climb; the tests of other autopilots have a fixture of their own."""
    px4.climb()
    return px4


@pytest.fixture
def ap(bench: Callable[..., Bench]) -> Bench:
    """Make an ArduCopter on the ground."""
    return bench("ardupilot")


@pytest.fixture
def plane(bench: Callable[..., Bench]) -> Bench:
    """Make an ArduPlane, armed on the ground."""
    it = bench("ardupilot", vehicle="plane")
    it.run(0.5)
    assert it.set_mode("GUIDED") == [0]
    assert it.requests(400, 1) == [0]
    return it


@pytest.fixture
def flying_plane(plane: Bench) -> Bench:
    """Let an ArduPlane take off and climb."""
    assert plane.set_mode("TAKEOFF") == [0]
    plane.until(lambda: plane.height > 45.0)
    return plane


@pytest.fixture(params=["ardupilot", "px4"])
def loaded(request: pytest.FixtureRequest, bench: Callable[..., Bench]) -> Bench:
    """Make a vehicle that has a mission."""
    made = bench(request.param)
    upload(made, plan(ardupilot=made.ardupilot))
    return made


@pytest.fixture
def offboard(flying: Bench) -> Bench:
    """Bring a flying PX4 into OFFBOARD."""
    flying.stream(0.5, 0.0)
    flying.set_mode("OFFBOARD")
    assert flying.mode == "OFFBOARD"
    return flying


@pytest.fixture
def rover(bench: Callable[..., Bench]) -> Bench:
    """Make an armed ArduRover in GUIDED."""
    it = bench("ardupilot", vehicle="rover")
    it.run(0.5)
    assert it.requests(176, 1, 15) == [0]  # DO_SET_MODE: GUIDED, accepted
    assert it.requests(400, 1) == [0]
    return it
