"""The simulated vehicle: messages in, messages out; no I/O and no clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from random import Random
from typing import Any, Literal

from pymavlink.dialects.v20 import all as mav

from fleet.sim.faults import check_fault
from fleet_mavlink.sim.ardupilot import ArduPilot
from fleet_mavlink.sim.autopilot import Autopilot, Boot
from fleet_mavlink.sim.battery import SimBattery
from fleet_mavlink.sim.command_request import decode_request
from fleet_mavlink.sim.equipment import Equipment
from fleet_mavlink.sim.faults import FAULTS
from fleet_mavlink.sim.mission_items import ARDUPILOT_BEHAVIOUR, PX4_BEHAVIOUR
from fleet_mavlink.sim.missions import SimMissions
from fleet_mavlink.sim.params import (
    ParameterValues,
    Params,
    ardupilot_params,
    plane_params,
    px4_params,
    px4_plane_params,
    quadplane_params,
    rover_params,
)
from fleet_mavlink.sim.physics import Body
from fleet_mavlink.sim.plane import SimArduPlane
from fleet_mavlink.sim.plane_physics import VtolBody, WingedBody
from fleet_mavlink.sim.px4 import SimPx4
from fleet_mavlink.sim.px4_plane import SimPx4Plane
from fleet_mavlink.sim.px4_vtol import SimPx4Vtol
from fleet_mavlink.sim.quadplane import SimQuadPlane
from fleet_mavlink.sim.remote_id import MESSAGES as REMOTE_ID_MESSAGES
from fleet_mavlink.sim.rover import SimArduRover
from fleet_mavlink.sim.rover_physics import WheeledBody
from fleet_mavlink.sim.spec import VehicleName
from fleet_mavlink.sim.streams import ALL_STREAMS, BUILDERS, DATA_STREAMS

FlavourName = Literal["ardupilot", "px4"]
_VEHICLES: Mapping[tuple[FlavourName, VehicleName], tuple[Callable[[Boot], Autopilot], type[Body]]] = {
    ("ardupilot", "multirotor"): (ArduPilot, Body),
    ("ardupilot", "rover"): (SimArduRover, WheeledBody),
    ("ardupilot", "plane"): (SimArduPlane, WingedBody),
    ("ardupilot", "vtol"): (SimQuadPlane, VtolBody),
    ("px4", "multirotor"): (SimPx4, Body),
    ("px4", "plane"): (SimPx4Plane, WingedBody),
    ("px4", "vtol"): (SimPx4Vtol, VtolBody),
}
_PARAMS: Mapping[tuple[FlavourName, VehicleName], Callable[[int], ParameterValues]] = {
    ("ardupilot", "multirotor"): ardupilot_params,
    ("ardupilot", "rover"): rover_params,
    ("ardupilot", "plane"): plane_params,
    ("ardupilot", "vtol"): quadplane_params,
    ("px4", "multirotor"): px4_params,
    ("px4", "plane"): px4_plane_params,
    ("px4", "vtol"): px4_plane_params,
}
ARDUPILOT_GREETING = b"\n\nInit ArduCopter V4.6.3 (92b0cd78)\n\nFree RAM: 131072\nInit Gyro***"
_STEP = 0.05  # s, longest step of the physics
_DARK = 1.0  # s of silence during a reboot
_DRIFT = 0.05  # share of the wind that the position control does not compensate
_HELD = 12.0  # m/s of wind that it can compensate; the excess carries the vehicle away
_COMPONENT = 1
_STATES = (mav.MAVLink_heartbeat_message, mav.MAVLink_extended_sys_state_message)  # see the fault state_lag


class SimVehicle:
    """One vehicle with its autopilot, from power-on.

    ``vehicle``: one that the ``flavour`` has in ``_VEHICLES``; KeyError for others.
    ``home``: latitude, longitude (degrees), altitude (m above sea level), heading (degrees).
    ``ready_after``: seconds until it can be armed; None: as long as the real one takes.
    ``epoch``: Unix time at time 0. All times are seconds of the simulation and only grow.
    """

    def __init__(
        self,
        flavour: FlavourName,
        *,
        vehicle: VehicleName = "multirotor",
        system_id: int = 1,
        home: tuple[float, float, float, float] = (47.397742, 8.545594, 488.0, 0.0),
        ready_after: float | None = None,
        faults: Mapping[str, float] | None = None,
        seed: int = 1,
        epoch: float = 0.0,
        now: float = 0.0,
    ) -> None:
        self.flavour = flavour
        self._made, body = _VEHICLES[flavour, vehicle]
        self.system_id = system_id
        self.faults: dict[str, float] = {}
        self.body = body(heading=math.radians(home[3]) % math.tau)
        self.time = now
        self._place = (home[0], home[1], home[2])
        self._ready_after = ready_after
        self._random = Random(seed * 1009 + system_id)  # noqa: S311 - reproducible, not secret
        self._epoch = epoch
        ardupilot = flavour == "ardupilot"
        self._battery = SimBattery(12.6, 9.6, int) if ardupilot else SimBattery(16.2, 13.2, math.ceil)
        values = _PARAMS[flavour, vehicle](system_id)
        self._params = Params(values, "cast" if ardupilot else "bytewise")
        self._missions = SimMissions(ARDUPILOT_BEHAVIOUR if ardupilot else PX4_BEHAVIOUR)
        self.equipment = Equipment(ardupilot=ardupilot)
        self._gust = 0.0
        self._dark_until = now
        self._late: list[tuple[float, object]] = []  # states that are not shown yet, with their times
        self.pilot = self._boot(now)
        for name, value in (faults or {}).items():
            self.set_fault(name, value)

    def _boot(self, now: float) -> Autopilot:
        """Start an autopilot with the body as it is."""
        boot = Boot(
            system_id=self.system_id,
            place=self._place,
            ready_after=self._ready_after,
            body=self.body,
            battery=self._battery,
            params=self._params,
            missions=self._missions,
            equipment=self.equipment,
            random=self._random,
            faults=self.faults,
            epoch=self._epoch,
            at=now,
        )
        return self._made(boot)

    def reboot(self, now: float) -> None:
        """Restart the autopilot: silent for a second, rates lost, parameters and mission kept."""
        self._params.reboot()
        self._missions.reboot()
        self.equipment.reboot()
        self._dark_until = now + _DARK
        self.pilot = self._boot(self._dark_until)

    def set_fault(self, name: str, value: float | None) -> None:
        """Activate a fault, or clear it with None; raises ValueError for an unknown one."""
        if value is None:
            check_fault(name, 1.0, FAULTS)
            self.faults.pop(name, None)
            return
        check_fault(name, value, FAULTS)
        once = _ONCE.get(name)
        if once is not None:
            once(self, value)
        else:
            self.faults[name] = value

    def handle(self, message: Any, now: float) -> list[object]:
        """Process one message of a station; return the immediate answers."""
        if self.time < self._dark_until:
            return []
        handler = _HANDLERS.get(message.get_type())
        if handler is None or not self._is_for_us(message):
            return []
        answers = handler(self.pilot, message)
        return self._drain(answers or (), now)

    def step(self, now: float) -> list[object]:
        """Advance to ``now``; return the periodic messages of the vehicle."""
        messages: list[object] = []
        while self.time < now:
            self.time = min(now, self.time + _STEP)
            if self.time <= self._dark_until:
                continue
            self.pilot.tick(self.time, self._wind())
            messages.extend(self._drain((), self.time))
        return messages

    def _drain(self, answers: Iterable[object], now: float) -> list[object]:
        """Return the output, and a handler's answers; reboot if requested."""
        messages = [*self.pilot.out, *answers]
        self.pilot.out.clear()
        if self.pilot.reboot_requested:
            self.reboot(now)
        return self._lagging(messages, now)

    def _lagging(self, messages: list[object], now: float) -> list[object]:
        """Return the messages without the states that are shown later, and with those that are due."""
        lag = self.faults.get("state_lag", 0.0)
        if not lag and not self._late:
            return messages
        self._late.extend((now + lag, each) for each in messages if isinstance(each, _STATES))
        due = [each for at, each in self._late if at <= now]
        self._late = [late for late in self._late if late[0] > now]
        return [*due, *(each for each in messages if not isinstance(each, _STATES))]

    def _wind(self) -> tuple[float, float]:
        """Return the effect of the wind, m/s north and east: a share as gusts, and the excess."""
        wind = self.faults.get("wind", 0.0)
        if not wind:
            return 0.0, 0.0
        self._gust = 0.98 * self._gust + 0.2 * self._random.gauss(0.0, 1.0)
        sensors = max(0.0, wind - _HELD)
        return 0.3 * _DRIFT * wind * self._gust, sensors + _DRIFT * wind * (1.0 + self._gust)

    def _is_for_us(self, message: Any) -> bool:
        """Return True if a message is addressed to this vehicle, or is a broadcast."""
        system = getattr(message, "target_system", None)
        if system is None or message.get_type() in {"TIMESYNC", "PING"}:
            return True
        broadcast = system == 0 and (self.pilot.obeys_broadcast or "COMMAND" not in message.get_type())
        component = (
            getattr(message, "target_component", 0) in {0, _COMPONENT} or self.pilot.obeys_other_components
        )
        return (system == self.system_id or broadcast) and component


def _reboot(vehicle: SimVehicle, _value: float) -> None:
    vehicle.reboot(vehicle.time)


def _low_battery(vehicle: SimVehicle, value: float) -> None:
    vehicle.pilot.battery.percent = min(100.0, value)


def _take_over(vehicle: SimVehicle, _value: float) -> None:
    mode = "LOITER" if vehicle.flavour == "ardupilot" else "POSCTL"
    vehicle.pilot.pilot_takes_over(vehicle.pilot.modes[mode])


_ONCE: Mapping[str, Callable[[SimVehicle, float], None]] = {
    "reboot": _reboot,
    "low_battery": _low_battery,
    "pilot_takeover": _take_over,
}


def _command(pilot: Any, message: object) -> None:
    pilot.command(decode_request(message))


def _data_stream(pilot: Autopilot, message: Any) -> None:
    """REQUEST_DATA_STREAM: ArduPilot only; stream 0 is all."""
    if not isinstance(pilot, ArduPilot):
        return
    wanted = ALL_STREAMS if message.req_stream_id == 0 else DATA_STREAMS.get(message.req_stream_id, ())
    rate = message.req_message_rate if message.start_stop else 0
    for message_id in wanted:
        pilot.streams.set(message_id, 1.0 / rate if rate else 0.0, pilot.time)


def _timesync(pilot: Autopilot, message: Any) -> Iterable[object]:
    """Answer a request (tc1 = 0) with the time since boot in nanoseconds."""
    return [] if message.tc1 else [mav.MAVLink_timesync_message(pilot.uptime.us * 1000, message.ts1)]


def _ping(_pilot: Autopilot, message: Any) -> Iterable[object]:
    """Answer a broadcast ping to its sender."""
    if message.target_system or message.target_component:
        return []
    requester = message.get_srcSystem(), message.get_srcComponent()
    return [mav.MAVLink_ping_message(message.time_usec, message.seq, *requester)]


def _heartbeat(pilot: Autopilot, message: Any) -> None:
    if message.type == mav.MAV_TYPE_GCS:
        pilot.gcs_heartbeat(message)


def _set_current(pilot: Autopilot, message: Any) -> Iterable[object]:
    """MISSION_SET_CURRENT, answered by MISSION_CURRENT."""
    if not pilot.missions.set_current(message.seq):
        return []
    return [BUILDERS[mav.MAVLINK_MSG_ID_MISSION_CURRENT](pilot)]


def _remote_id(pilot: Autopilot, message: object) -> None:
    """Open Drone ID: processed only by an autopilot with a transmitter."""
    if pilot.equipment.remote_id is not None:
        pilot.equipment.remote_id.handle_message(message, pilot.time)


def _list_logs(pilot: Autopilot, message: object) -> Iterable[object]:
    """LOG_REQUEST_LIST: ArduPilot lists its logs on the ground only."""
    if pilot.armed and isinstance(pilot, ArduPilot):
        pilot.send_text_once(3, "Disarm for log download")
        return []
    return pilot.equipment.logs.requested_list(message)


_HANDLERS: Mapping[str, Callable[[Any, object], Iterable[object] | None]] = {
    "COMMAND_INT": _command,
    "COMMAND_LONG": _command,
    "FILE_TRANSFER_PROTOCOL": lambda pilot, message: pilot.equipment.files.requested(message),
    "HEARTBEAT": _heartbeat,
    "LOG_REQUEST_DATA": lambda pilot, message: pilot.equipment.logs.requested_data(message),
    "LOG_REQUEST_END": lambda pilot, _message: pilot.equipment.logs.requested_end(),
    "LOG_REQUEST_LIST": _list_logs,
    "MISSION_CLEAR_ALL": lambda pilot, message: pilot.missions.clear(message),
    "MISSION_COUNT": lambda pilot, message: pilot.missions.upload.count(message, pilot.time),
    "MISSION_ITEM": lambda pilot, message: pilot.missions.upload.item(message, pilot.time),
    "MISSION_ITEM_INT": lambda pilot, message: pilot.missions.upload.item(message, pilot.time),
    "MISSION_REQUEST": lambda pilot, message: pilot.missions.request(message, pilot.home.place),
    "MISSION_REQUEST_INT": lambda pilot, message: pilot.missions.request(message, pilot.home.place),
    "MISSION_REQUEST_LIST": lambda pilot, message: pilot.missions.request_list(message),
    "MISSION_SET_CURRENT": _set_current,
    **dict.fromkeys(REMOTE_ID_MESSAGES, _remote_id),
    "PARAM_REQUEST_LIST": lambda pilot, _message: pilot.params.requested_list(),
    "PARAM_REQUEST_READ": lambda pilot, message: pilot.params.requested_read(message),
    "PARAM_SET": lambda pilot, message: pilot.params.requested_set(message),
    "PING": _ping,
    "REQUEST_DATA_STREAM": _data_stream,
    "SET_MODE": lambda pilot, message: pilot.set_mode(message),
    "SET_POSITION_TARGET_GLOBAL_INT": lambda pilot, message: pilot.setpoints.receive(message),
    "SET_POSITION_TARGET_LOCAL_NED": lambda pilot, message: pilot.setpoints.receive(message),
    "TIMESYNC": _timesync,
}
