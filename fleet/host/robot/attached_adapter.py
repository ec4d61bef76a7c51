"""The adapter of one robot's current run, and whether the robot can be reached through it."""

from __future__ import annotations

from typing import Any

from fleet.adapter import Adapter
from fleet.host.requests.event_reporter import robot_log
from fleet.runtime.exception_barrier import call_guarded


class AttachedAdapter:
    """The current adapter of a robot, if any, and the reachability of the robot."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.adapter: Adapter[Any] | None = None
        self.offline = "it has not been reached yet"  # why it cannot be reached; empty while it can
        self._answered = False  # since the adapter's run began

    def attach(self, adapter: Adapter[Any]) -> None:
        """Attach the adapter of a new run, through which the robot has not answered yet."""
        self.adapter, self._answered = adapter, False

    def detach(self) -> None:
        """Detach the adapter at the end of its run."""
        self.adapter = None

    def answers(self) -> None:
        """Note that the robot answers: it can be reached from now on."""
        self.offline, self._answered = "", True

    @property
    def reachable(self) -> Adapter[Any] | None:
        """The adapter while the robot can be reached through it; else None."""
        return None if self.offline else self.adapter

    @property
    def absence(self) -> str:
        """The refusal of a request while the robot cannot be reached."""
        return f"{self.name} is offline: {self.offline or 'its adapter is being restarted'}"

    def halt(self, *, emergency: bool = False) -> None:
        """Have the adapter write its halt at once; from any thread; never raises."""
        adapter = self.adapter
        try:
            if adapter is not None:
                call_guarded(adapter.emergency_halt if emergency else adapter.halt)
        except Exception:  # noqa: BLE001 - logged: the caller goes on with the next robot
            robot_log(self.name).exception("its halt failed")

    @property
    def halt_outcome(self) -> str:
        """The probable effect of a halt on a robot that cannot be reached, for the answer to a stop."""
        if self.adapter is None:
            return "the stop was not written: no link to it is open"
        if not self._answered:
            return "the stop may not have been written: it has not been heard since its adapter began"
        return "the stop was written, but the robot does not answer"
