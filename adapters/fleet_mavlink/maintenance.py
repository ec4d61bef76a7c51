"""Maintenance commands: readiness, parameters, logs, compass, signing, reboot."""

from __future__ import annotations

import base64
import math
from collections.abc import AsyncIterator
from typing import Annotated

from fleet import Progress, Range, Refused, command
from fleet_mavlink import readiness
from fleet_mavlink.logs import MOST_BYTES
from fleet_mavlink.parameters import Parameter
from fleet_mavlink.session_adapter import SessionAdapter

_Value = Annotated[float, Range(-3.4e38, 3.4e38, "in the parameter's own unit")]


class UpkeepCommands(SessionAdapter):
    """Commands for maintenance on the ground."""

    @command("check_ready", moves=False, safe=True)
    async def check_ready(self) -> dict[str, object]:
        """Check whether it would take off now: a list of checks, with the autopilot's own texts."""
        found = await readiness.inspect(self._session.flight)
        listed = [{"check": each.check, "ok": each.ok, "words": list(each.words)} for each in found]
        return {"ready": readiness.is_ready(found), "checks": listed}

    @command("get_parameters", timeout=120.0, moves=False, safe=True)
    async def get_parameters(self, *, names: list[str] | None = None) -> dict[str, float | int | None]:
        """Read parameters by name; without names, all of them."""
        parameters = self._session.parameters
        found = await parameters.read_all() if names is None else await parameters.read(names)
        return {each.name: _number(each) for each in found}

    @command("set_parameter", timeout=15.0, moves=False)
    async def set_parameter(
        self, *, name: str, value: _Value, force: bool = False
    ) -> dict[str, float | int | str | None]:
        """Write a parameter and read it back; on the ground unless ``force``."""
        session = self._session
        if session.vehicle.state.armed and not force:
            raise Refused("it is armed", hint="disarm first, or say force=true")
        before, after = await session.parameters.write(name, value)
        return {"name": name, "before": _number(before), "after": _number(after)}

    @command("list_logs", timeout=30.0, moves=False, safe=True)
    async def list_logs(self) -> list[dict[str, int]]:
        """List the logs on board: id, bytes, Unix time of each."""
        return [{"id": log.id, "size": log.size, "time": log.time} for log in await self._session.logs.list()]

    @command("read_log", timeout=90.0, moves=False, safe=True)
    async def read_log(
        self,
        *,
        id: Annotated[int, Range(0, 65_535, "as list_logs numbers them")],  # noqa: A002
        offset: Annotated[int, Range(0, 2**32 - 1, "bytes")] = 0,
        count: Annotated[int, Range(1, MOST_BYTES, "bytes")] = 32768,
    ) -> dict[str, object]:
        """Read a part of a log, as base64; ``fleet flight-logs get`` fetches a whole log."""
        data = await self._session.logs.read(id, offset, count)
        return {"offset": offset, "count": len(data), "data": base64.b64encode(data).decode()}

    @command("start_compass_calibration", timeout=300.0, in_place=True)
    async def start_compass_calibration(self) -> AsyncIterator[Progress]:
        """Calibrate the compass: rotate the vehicle about all its axes until it is done."""
        async for progress in self._session.compass.calibrate():
            yield progress

    @command("stop_compass_calibration", moves=False)
    async def stop_compass_calibration(self) -> None:
        """Stop the calibration of the compass; its result is discarded."""
        await self._session.compass.stop()

    @command("setup_signing", timeout=15.0, moves=False)
    async def setup_signing(self) -> None:
        """Send the autopilot our signing key, over a link without listeners; it signs from then on."""
        await self._session.setup_signing()

    @command("reboot", "reboot_aircraft", in_place=True)
    async def reboot(self) -> None:
        """Restart the autopilot; refused while it is armed."""
        await self._session.flight.reboot()


def _number(parameter: Parameter) -> float | int | None:
    """Return a parameter's value, None for NaN and infinity, which JSON lacks."""
    return parameter.value if math.isfinite(parameter.value) else None
