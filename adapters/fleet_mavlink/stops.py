"""The stops and halts of the adapter."""

from __future__ import annotations

import contextlib

from fleet import LinkError, NotReady
from fleet_mavlink.session import GENTLE
from fleet_mavlink.session_adapter import SessionAdapter

_TAKE_OVER = frozenset({"hover", "brake", "emergency_stop"})
"""The stops that mean the vehicle itself, whoever has it; the others end what we do with it."""
_ASKED = _TAKE_OVER | {GENTLE, "pause"}
"""The stops that somebody asked for; the others are the host's own, when something failed or ends."""


class StopCommands(SessionAdapter):
    """Stops of the vehicle of a session."""

    async def stop(self, reason: str) -> None:
        """Brake and hold in the air; motors are never cut.

        A landing, or a flight home, is the autopilot's own and the safest that is left when an edge ends: it
        is broken off for somebody who asks for it only. What is not moved here is braked for nobody else.
        Raises a CommandError when the vehicle was not seen to stop.
        """
        if reason not in _ASKED and not self._session.is_ours_to_stop:
            return
        try:
            await self._session.stop(reason, takes_over=reason in _TAKE_OVER)
        except LinkError as error:
            raise NotReady(f"nobody knows whether it stops: {error}") from error

    def halt(self) -> None:
        """Write zero velocity, or the hold command, at once; from any thread. A landing goes on."""
        with contextlib.suppress(LinkError):
            self._session.halts.halt()

    def emergency_halt(self) -> None:
        """Write the same, whatever it does and whoever has it; from any thread."""
        with contextlib.suppress(LinkError):
            self._session.halts.halt(takes_over=True)

    def halt_unheard(self, reason: str) -> bool:
        """Write a requested stop to a vehicle that is not heard, or was heard long ago; from any thread."""
        self._session.halts.write(takes_over=reason in _TAKE_OVER)
        return True
