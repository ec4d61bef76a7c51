"""Access of the ground stations of one link to one vehicle: passes on, or refuses with the reason."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import all as mav

from fleet import LinkLost
from fleet_mavlink.authentication import FALSE, UNSIGNED
from fleet_mavlink.authority import Authority
from fleet_mavlink.codec import Frame
from fleet_mavlink.constants import AUTOPILOT
from fleet_mavlink.flavour import Flavour
from fleet_mavlink.link_hub import LinkHub
from fleet_mavlink.messages import CommandLong
from fleet_mavlink.rate_limited_log import RateLimitedLog
from fleet_mavlink.station_permissions import (
    RequiredPermission,
    arms,
    comes_down,
    required_permission,
    why_not_at_this_rate,
)
from fleet_mavlink.station_refusals import refusal, unchanged, words
from fleet_mavlink.vehicle import Vehicle
from fleet_mavlink.vehicle_kind import VehicleKind
from fleet_mavlink.watcher import Watcher
from fleet_mavlink.watcher_config import WatcherConfig

_OUR_LINK = 2  # signature link id of frames created here, which have time stamps of their own
_FOR_OPERATORS = frozenset({RequiredPermission.OPERATOR, RequiredPermission.TAKES_OVER})
_TAKES = frozenset({RequiredPermission.STOP, RequiredPermission.TAKES_OVER})


class WatchedVehicle:
    """One vehicle for the stations of one link.

    ``stopped``: whether an emergency stop is set; ``halt`` stops the vehicle by this edge's own means.
    """

    def __init__(
        self,
        config: WatcherConfig,
        watcher: Watcher,
        hub: LinkHub,
        vehicle: Vehicle,
        *,
        authority: Authority,
        stopped: Callable[[], bool],
        halt: Callable[[], object],
        log: logging.Logger,
    ) -> None:
        self._config = config
        self._watcher = watcher
        self._hub = hub
        self._vehicle = vehicle
        self._authority = authority
        self._stopped, self._halt = stopped, halt
        self._notices = RateLimitedLog(log, vehicle.now)
        self._packer = mav.MAVLink(None)
        self._reader = mav.MAVLink(None)

    def show(self, frame: Frame) -> None:
        """Show a frame of the vehicle."""
        self._watcher.show(frame.raw)

    def handle_frame(self, frame: Frame) -> None:
        """Pass a station's message on, or refuse it."""
        try:
            message = self._reader.decode(bytearray(frame.raw))
        except mav.MAVError as error:
            self._notices.add("not MAVLink", f"{self._config.link}: {error}")
            return
        need = required_permission(message, stops_of(self._vehicle))
        if need is RequiredPermission.NOBODY_HEARS:
            return
        why = self._why_not(need, frame, message)
        if why:
            self._refuse(message, why)
            return
        if need in _TAKES:
            self._give_up(need, message, f"ground station {frame.system}/{frame.component}")
        self._pass_on(frame.raw)

    def _give_up(self, need: RequiredPermission, message: Any, who: str) -> None:
        """Yield authority to a station that commands the vehicle, or arms it."""
        kind, state = self._vehicle.kind, self._vehicle.state
        if need is RequiredPermission.STOP:
            self._halt()  # this vehicle may not accept the station's own command
        if not isinstance(kind, Flavour):
            return
        if not state.armed:
            if arms(message):
                self._authority.armed_by(who)
            return
        self._authority.lose_to(who, kind.mode_of(state))

    def _why_not(self, need: RequiredPermission, frame: Frame, message: Any) -> str:
        """Return why a message is refused, empty if it is permitted."""
        if (frame.system, frame.component) == (self._hub.system, self._hub.component):
            return "it has the ids of this edge (own_system, own_component)"
        signer = self._vehicle.trust.signer
        if signer is not None and not (frame.signed and signer.accepts(frame.signed)):
            return FALSE if frame.signed else UNSIGNED
        if need is RequiredPermission.NOBODY:
            return _why_nobody(message)
        if need not in _FOR_OPERATORS:
            return ""
        why = self._why_no_operator(frame)
        if why or need is RequiredPermission.OPERATOR or not self._stopped():
            return why
        return "" if comes_down(message, descent_commands_of(self._vehicle)) else "an emergency stop is set"

    def _why_no_operator(self, frame: Frame) -> str:
        """Return why a station may not operate the vehicle, empty if it may."""
        if self._config.may != "operate":
            return "may: watch"
        if frame.system != self._config.station:
            return f"station {self._config.station} operates, not {frame.system}"
        return ""

    def _refuse(self, message: Any, why: str) -> None:
        """Send a refusal by the means of the protocol, and its reason as text once a minute."""
        name = message.get_type()
        station = f"{message.get_srcSystem()}/{message.get_srcComponent()}"
        line = f"ground station {station} at {self._config.link}: {name} refused: {why}"
        answers = [] if (answer := refusal(message)) is None else [answer]
        component = getattr(message, "target_component", 0) or AUTOPILOT
        for each in answers:
            self._watcher.show(self._framed(each, self._vehicle.system, component))
        if self._notices.add(f"{name} {why}", line):
            for each in words(f"{name} refused: {why}"):
                self._watcher.show(self._framed(each, self._vehicle.system, self._hub.component))
        kept = unchanged(message)
        if kept is not None and why not in {FALSE, UNSIGNED}:
            place = message.get_srcSystem(), message.get_srcComponent()
            self._pass_on(self._framed(kept, *place))

    def _framed(self, message: Any, system: int, component: int) -> bytes:
        """Return a frame in the name of a component, signed if the vehicle's own are."""
        packer, signer = self._packer, self._vehicle.trust.signer
        packer.srcSystem, packer.srcComponent = system, component
        packer.seq = (packer.seq + 1) & 0xFF
        if signer is not None:
            packer.signing.secret_key, packer.signing.link_id = signer.key, _OUR_LINK
            packer.signing.timestamp, packer.signing.sign_outgoing = signer.stamp(), True
        return bytes(message.pack(packer))

    def _pass_on(self, frame: bytes) -> None:
        """Send to the vehicle."""
        try:
            self._hub.link.send(frame, self._vehicle.address)
        except LinkLost as error:
            self._notices.add("link lost", f"{self._config.link}: not passed on: {error}")


def stops_of(vehicle: Vehicle) -> list[CommandLong]:
    """Return the commands that brake and hold a vehicle in its present motion.

    A position to hold at is not among them: with another position the same command would move it.
    """
    kind: VehicleKind | None = vehicle.kind
    if kind is None:
        return []
    requests = (brake.request for brake in kind.brakes(vehicle.state))
    stops = [request for request in requests if isinstance(request, CommandLong)]
    if isinstance(kind, Flavour) and isinstance(kind.hold_command(vehicle.state), CommandLong):
        stops.append(kind.mode_command(kind.hold))
    landing = kind.mode_command(kind.land) if isinstance(kind, Flavour) and kind.land else None
    return [stop for stop in stops if stop != landing]  # lands a QuadPlane that cannot hold


def descent_commands_of(vehicle: Vehicle) -> list[CommandLong]:
    """Return the commands that make a vehicle land, or return home."""
    kind = vehicle.kind
    if not isinstance(kind, Flavour):
        return []
    commands = [kind.land_command()] if kind.land else []
    commands += [kind.mode_command(kind.return_home)] if kind.return_home else []
    return [request for request in commands if isinstance(request, CommandLong)]


def _why_nobody(message: Any) -> str:
    """Return why a message is never passed on."""
    if message.get_type() in {"COMMAND_LONG", "COMMAND_INT"}:
        return why_not_at_this_rate(message)
    return "it is not passed on through this edge"
