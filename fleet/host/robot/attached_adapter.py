"""The adapter of one robot's present run, and whether the robot answers through it."""

from __future__ import annotations

from typing import Any

from fleet.adapter import Adapter
from fleet.host.requests.event_reporter import robot_log
from fleet.runtime.exception_barrier import call_guarded


class AttachedAdapter:
    """The robot's present adapter, if any, and whether the robot can be reached through it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.adapter: Adapter[Any] | None = None
        self.offline = "it has not been reached yet"  # why it cannot be reached; empty while it can
        self._answered = False  # since the adapter's run began

    def attach(self, adapter: Adapter[Any]) -> None:
        """Use the adapter of a new run; the robot has not answered through it yet."""
        self.adapter, self._answered = adapter, False

    def detach(self) -> None:
        """Remove the adapter, at the end of its run."""
        self.adapter = None

    def answers(self) -> None:
        """Record that the robot answers: it accepts requests from now on."""
        self.offline, self._answered = "", True

    @property
    def reachable(self) -> Adapter[Any] | None:
        """The adapter while the robot can be reached through it; else None."""
        return None if self.offline else self.adapter

    @property
    def absence(self) -> str:
        """Why the robot cannot be reached, as an answer."""
        return f"{self.name} is offline: {self.offline or 'its adapter is being restarted'}"

    def halt(self, *, emergency: bool = False) -> None:
        """Make the adapter write its halt at once; from any thread; never raises."""
        adapter = self.adapter
        try:
            if adapter is not None:
                call_guarded(adapter.emergency_halt if emergency else adapter.halt)
        except Exception:  # noqa: BLE001 - logged: the caller goes on with the next robot
            robot_log(self.name).exception("its halt failed")

    @property
    def halt_outcome(self) -> str:
        """Outcome of the halt of an unreachable robot, as text."""
        if self.adapter is None:
            return "the stop was not written: no link to it is open"
        if not self._answered:
            return "the stop may not have been written: it has not been heard since its adapter began"
        return "the stop was written, but the robot does not answer"
