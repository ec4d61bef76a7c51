"""Compass calibration with progress; the flavour interprets the messages of its autopilot."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from fleet import CommandError, LinkError, Progress, Refused, TimedOut
from fleet_mavlink.flight import Flight
from fleet_mavlink.messages import MavlinkMessage
from fleet_mavlink.payload_messages import MagCalProgress, MagCalReport
from fleet_mavlink.preconditions import require_connection
from fleet_mavlink.received_messages import ReceivedMessages
from fleet_mavlink.statustext import Sentence

_SILENCE = 15.0  # s without a message after which the calibration counts as ended
_CANCELLED = Sentence("cancelled", 6, 0.0)

CompassMessage = MavlinkMessage | Sentence


class Compass:
    """Compass calibration of one vehicle, on the ground with the motors off."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._heard: ReceivedMessages[CompassMessage] | None = None

    async def calibrate(self) -> AsyncIterator[Progress]:
        """Calibrate while a person rotates the vehicle, yielding progress until it is calibrated.

        Raises Refused with the autopilot's reason if it fails or is stopped. Closing the generator early
        stops the calibration.
        """
        flight = self._flight
        require_connection(flight.vehicle)
        if flight.vehicle.state.armed:
            raise Refused("it is armed", hint="land and disarm first")
        with flight.vehicle.hearing(MagCalProgress, MagCalReport, Sentence) as heard:
            await self._start()
            self._heard = heard
            try:
                async for progress in self._follow(heard):
                    yield progress
            except (CommandError, GeneratorExit, asyncio.CancelledError):
                await self._stop_quietly()
                raise
            finally:
                self._heard = None

    async def _start(self) -> None:
        """Start a calibration; one that the vehicle has not answered may have begun, and is stopped."""
        try:
            await self._flight.commander.request(self._flight.flavour.compass_start, tries=1)
        except (TimedOut, asyncio.CancelledError):
            await self._stop_quietly()
            raise

    async def stop(self) -> None:
        """Stop a calibration; its result is discarded."""
        require_connection(self._flight.vehicle)
        if self._flight.vehicle.state.armed:
            raise Refused("it is armed", hint="no compass is calibrated in flight")
        await self._flight.commander.request(self._flight.flavour.compass_stop)
        if self._heard is not None:
            self._heard.put(_CANCELLED)

    async def _follow(self, heard: ReceivedMessages[CompassMessage]) -> AsyncIterator[Progress]:
        """Follow the calibration to its end; the slowest compass determines the progress."""
        step_of = self._flight.flavour.calibration_step
        percents: dict[int, float] = {}
        yield Progress(0.0, "turn the vehicle about all its axes")
        while True:
            said = await heard.next(_SILENCE)
            if said is None:
                raise TimedOut(f"no progress of the calibration was received for {_SILENCE:g} s")
            if said is _CANCELLED:
                raise Refused("it was stopped")
            step = step_of(said)
            if step is None:
                continue
            percents |= dict.fromkeys(step.others - percents.keys(), 0.0) | {step.compass: step.percent}
            slowest = min(percents.values())
            if slowest >= 100.0:
                break
            yield Progress(min(99.0, slowest), "calibrating")
        yield Progress(100.0, "calibrated")

    async def _stop_quietly(self) -> None:
        """Stop the calibration on the vehicle; failures are ignored."""
        with contextlib.suppress(CommandError, LinkError):
            await self._flight.commander.request(self._flight.flavour.compass_stop, tries=1)
