"""Verification and setting of the autopilot's fail-safe parameters: loss of edge, battery or position.

The edge may die while the autopilot flies to a goal by itself; then only the autopilot can react. Its
parameters are therefore read at each connect and after each of its reboots. Wrong values are reported as
health; they are corrected only if fleet.yaml, or a command, requests it, and never while the motors run.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Literal

import msgspec

from fleet import CommandError, NotReady, Refused
from fleet_mavlink.parameters import Parameters
from fleet_mavlink.preconditions import require_connection
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import Vehicle

_FOREVER = 3600.0  # s between checks when nothing happens
_BEATS_TO_TELL = 5  # heartbeats within which a vehicle reports its equipment, if at all
_AGAIN = 10.0  # s until parameters that could not be read are read again

LinkLoss = Literal["return_to_home", "land", "continue"]
Keeping = Literal["check", "set", "ignore"]


class ParameterRule(msgspec.Struct, frozen=True):
    """Rule for one parameter: its ``names`` in different versions, accepted values, value to write."""

    names: tuple[str, ...]
    good: frozenset[int]
    wanted: int
    danger: str


_ROVER_ACTS = ParameterRule(("FS_GCS_ENABLE",), frozenset({1}), 1, "it drives on when the edge is lost")
_PLANE_ACTS = (
    ParameterRule(("FS_GCS_ENABL",), frozenset({1, 2, 3}), 1, "it flies on when the edge is lost"),
    ParameterRule(("FS_LONG_ACTN",), frozenset({1}), 1, "it does not return when the edge is lost"),
)
"""A plane lands only with a landing in its mission, so it returns home in either case."""
_PLANE_BATTERY = ParameterRule(
    ("BATT_FS_LOW_ACT",), frozenset(range(1, 8)), 1, "it flies on with an empty battery"
)
_PLANE_RADIO = ParameterRule(
    ("THR_FAILSAFE",), frozenset({1, 2}), 1, "it flies on when the remote control is lost"
)
_HOVERS_IN_GUIDED = ParameterRule(
    ("Q_GUIDED_MODE",), frozenset({1}), 1, "a stop in its hover can only land it, and it is not moved"
)
_ON_LINK_LOSS: Mapping[str, Mapping[str, tuple[ParameterRule, ...]]] = {
    "ardupilot": {
        "return_to_home": (
            ParameterRule(
                ("FS_GCS_ENABLE",), frozenset({1, 3, 4, 5}), 1, "it flies on when the edge is lost"
            ),
        ),
        "land": (
            ParameterRule(("FS_GCS_ENABLE",), frozenset({5}), 5, "it does not land when the edge is lost"),
        ),
    },
    "ardurover": {
        "return_to_home": (
            _ROVER_ACTS,
            ParameterRule(("FS_ACTION",), frozenset({1, 3}), 1, "it does not return when the edge is lost"),
        ),
        "land": (
            _ROVER_ACTS,
            ParameterRule(("FS_ACTION",), frozenset({2}), 2, "it does not stop when the edge is lost"),
        ),
    },
    "arduplane": dict.fromkeys(("return_to_home", "land"), _PLANE_ACTS),
    "quadplane": dict.fromkeys(("return_to_home", "land"), _PLANE_ACTS),
    "px4": {
        "return_to_home": (
            ParameterRule(("NAV_DLL_ACT",), frozenset({2, 3}), 2, "it flies on when the edge is lost"),
        ),
        "land": (
            ParameterRule(("NAV_DLL_ACT",), frozenset({3}), 3, "it does not land when the edge is lost"),
        ),
    },
}
_ON_RADIO_LOSS: Mapping[str, ParameterRule] = {
    "ardupilot": ParameterRule(
        ("FS_THR_ENABLE",), frozenset(range(1, 8)), 1, "it flies on when the remote control is lost"
    ),
    "ardurover": ParameterRule(
        ("FS_THR_ENABLE",), frozenset({1, 2}), 1, "it drives on when the remote control is lost"
    ),
    "arduplane": _PLANE_RADIO,
    "quadplane": _PLANE_RADIO,
    "px4": ParameterRule(
        ("NAV_RCL_ACT",), frozenset({1, 2, 3}), 2, "it flies on when the remote control is lost"
    ),
}
_ALWAYS: Mapping[str, tuple[ParameterRule, ...]] = {
    "ardupilot": (
        ParameterRule(("BATT_FS_LOW_ACT",), frozenset(range(1, 8)), 2, "it flies on with an empty battery"),
        ParameterRule(("FS_EKF_ACTION",), frozenset({1, 2, 3}), 1, "it flies on without a position"),
    ),
    "ardurover": (
        ParameterRule(("BATT_FS_LOW_ACT",), frozenset(range(1, 6)), 2, "it drives on with an empty battery"),
        ParameterRule(("FS_EKF_ACTION",), frozenset({1}), 1, "it drives on without a position"),
    ),
    "arduplane": (_PLANE_BATTERY,),
    "quadplane": (_HOVERS_IN_GUIDED, _PLANE_BATTERY),
    "px4": (
        ParameterRule(("COM_LOW_BAT_ACT",), frozenset({2, 3}), 3, "it flies on with an empty battery"),
        ParameterRule(
            ("COM_OBL_RC_ACT",), frozenset({3, 4, 5}), 5, "it sinks when setpoints stop and no pilot is there"
        ),
    ),
}


def rules_for(table: str, link_loss: LinkLoss, station: int, *, receiver: bool) -> tuple[ParameterRule, ...]:
    """Return the rules of a table; ``station``: our own system id, whose loss ArduPilot then detects.

    Without a ``receiver`` for a remote control there is no rule about its loss: ArduPilot could not be armed
    with it.
    """
    rules = _ALWAYS[table] + ((_ON_RADIO_LOSS[table],) if receiver else ())
    lost = _ON_LINK_LOSS[table].get(link_loss)
    if lost is None:
        return rules
    if table == "px4":
        return (*lost, *rules)
    watched = ParameterRule(
        ("SYSID_MYGCS", "MAV_GCS_SYSID"),
        frozenset({station}),
        station,
        f"it watches another station than this edge ({station})",
    )
    return (*lost, watched, *rules)


class Failsafes:
    """Fail-safes of one vehicle; ``troubles`` lists the problems, empty without any.

    ``persistent``: written parameters outlive this edge, so they are logged as a warning. A simulated vehicle
    starts with the autopilot's defaults each time.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        parameters: Parameters,
        *,
        keeping: Keeping,
        link_loss: LinkLoss,
        station: int,
        persistent: bool,
        changed: Callable[[], None],
    ) -> None:
        self.troubles: tuple[str, ...] = ()
        self._vehicle = vehicle
        self._parameters = parameters
        self._keeping = keeping
        self._link_loss = link_loss
        self._station = station
        self._log_level = logging.WARNING if persistent else logging.INFO
        self._changed = changed

    async def run(self) -> None:
        """Verify at each connect and after each reboot, until cancelled."""
        while True:
            await self._met()
            reboots = self._vehicle.state.reboots
            wait = _FOREVER if await self._looked() else _AGAIN
            await self._vehicle.restarted(reboots, wait)

    async def _looked(self) -> bool:
        """Verify, and correct if configured; return False if the parameters could not be read."""
        if self._keeping == "ignore":
            return True
        try:
            if self._keeping == "set" and not self._vehicle.state.armed:
                await self.set()  # a value that is corrected at once need not be reported
                return True
            await self.verify()
            if self.troubles and self._keeping == "set":
                await self._set_on_the_ground()
        except CommandError as error:
            self._report((f"its fail-safes could not be verified: {error.reason}",))
            return False
        return True

    async def verify(self) -> None:
        """Read the parameters and store the problems; raises like reading a parameter."""
        self._report(tuple([trouble for rule in self._rules() if (trouble := await self._trouble(rule))]))

    async def set(self) -> None:
        """Correct wrong parameters; raises Refused while the motors run."""
        require_connection(self._vehicle)
        if self._vehicle.state.armed:
            raise Refused("it is armed", hint="land and disarm first")
        for rule in self._rules():
            name, value = await self._read(rule)
            if value not in rule.good:
                await self._parameters.write(name, rule.wanted)
                said = "fail-safe %s was %g (%s) and is %g now"
                self._vehicle.log.log(self._log_level, said, name, value, rule.danger, rule.wanted)
        await self.verify()

    async def _set_on_the_ground(self) -> None:
        """Set them as soon as the motors are off."""
        await self._vehicle.until(lambda state: not state.armed, _FOREVER)
        await self.set()

    async def _met(self) -> None:
        """Wait for a vehicle of a known kind, and give it time to report its equipment."""

        def known(state: VehicleState) -> bool:
            reported = state.prearm_ok is not None or state.beats > _BEATS_TO_TELL
            return reported and self._vehicle.connected and self._vehicle.flavour is not None

        while not await self._vehicle.until(known, _FOREVER):
            self._vehicle.log.debug("it is still not met")

    def _rules(self) -> tuple[ParameterRule, ...]:
        """Return the rules for this vehicle; raises NotReady before its kind is known."""
        flavour = self._vehicle.flavour
        if flavour is None:
            raise NotReady("it is not known yet which autopilot this is")
        receiver = self._vehicle.state.remote_control is not None
        return rules_for(flavour.failsafe_table, self._link_loss, self._station, receiver=receiver)

    async def _trouble(self, rule: ParameterRule) -> str:
        """Return the problem of one parameter, empty without one."""
        name, value = await self._read(rule)
        return "" if value in rule.good else f"{name} is {value:g}: {rule.danger} (send set_failsafes)"

    async def _read(self, rule: ParameterRule) -> tuple[str, float]:
        """Return the parameter's name in this version, and its value; raises Refused if there is none."""
        for name in rule.names[:-1]:
            try:
                return name, (await self._parameters.read([name]))[0].value
            except Refused:
                continue
        return rule.names[-1], (await self._parameters.read(rule.names[-1:]))[0].value

    def _report(self, troubles: tuple[str, ...]) -> None:
        """Store the problems, and report them if they have changed."""
        if troubles != self.troubles:
            self.troubles = troubles
            self._changed()
