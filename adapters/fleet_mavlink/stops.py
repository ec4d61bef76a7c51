"""The stops and halts of the adapter."""

from __future__ import annotations

import contextlib

from fleet import LinkError, NotReady
from fleet_mavlink.session import GENTLE
from fleet_mavlink.session_adapter import SessionAdapter

_TAKE_OVER = frozenset({"hover", "brake", "emergency_stop"})
"""Stops of the vehicle itself, also under another operator's control; the others end only our own motion."""
_REQUESTED = _TAKE_OVER | {GENTLE, "pause"}
"""Stops that a sender requested; the host itself causes the others, after a failure or at its end."""


class StopCommands(SessionAdapter):
    """Stops of the vehicle of a session."""

    async def stop(self, reason: str) -> None:
        """Brake and hold in the air; motors are never cut.

        A landing or a flight home is executed by the autopilot itself, and is the safest way left when an
        edge ends: only a requested stop breaks it off, or brakes a vehicle that this edge does not move.
        Raises a CommandError when the vehicle was not seen to stop.
        """
        if reason not in _REQUESTED and not self._session.is_ours_to_stop:
            return
        try:
            await self._session.stop(reason, takes_over=reason in _TAKE_OVER)
        except LinkError as error:
            raise NotReady(f"it is unknown whether it stops: {error}") from error

    def halt(self) -> None:
        """Write zero velocity, or the hold command, at once; from any thread. A landing goes on."""
        with contextlib.suppress(LinkError):
            self._session.halts.halt()

    def emergency_halt(self) -> None:
        """Write the same in any state and under any control; from any thread."""
        with contextlib.suppress(LinkError):
            self._session.halts.halt(takes_over=True)

    def halt_unheard(self, reason: str) -> bool:
        """Write a requested stop to a silent vehicle; from any thread."""
        self._session.halts.write(takes_over=reason in _TAKE_OVER)
        return True
