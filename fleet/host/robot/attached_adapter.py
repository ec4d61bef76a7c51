"""The adapter of one robot's current run, and whether the robot can be reached through it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fleet.adapter import Adapter
from fleet.errors import CommandError, LinkError
from fleet.host.requests.event_reporter import robot_log
from fleet.host.runtime.threads import run_in_thread
from fleet.runtime.exception_barrier import call_guarded, failure_text


class AttachedAdapter:
    """The current adapter of a robot, if any, and the reachability of the robot.

    ``halt_failed`` receives what the adapter's halt raised, on any thread.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.adapter: Adapter[Any] | None = None
        self.halt_failed: Callable[[Exception], None] = lambda _: None
        self.offline = "it has not been reached yet"  # why it cannot be reached; empty while it can

    def attach(self, adapter: Adapter[Any]) -> None:
        """Attach the adapter of a new run."""
        self.adapter = adapter

    def detach(self) -> None:
        """Detach the adapter at the end of its run."""
        self.adapter = None

    def mark_reachable(self) -> None:
        """Note that the robot answers: it can be reached from now on."""
        self.offline = ""

    @property
    def reachable(self) -> Adapter[Any] | None:
        """The adapter while the robot can be reached through it; else None."""
        return None if self.offline else self.adapter

    @property
    def unreachable_refusal(self) -> str:
        """The refusal of a request while the robot cannot be reached."""
        return f"{self.name} is offline: {self.offline or 'its adapter is being restarted'}"

    def halt(self, *, emergency: bool = False) -> None:
        """Have the adapter write its halt at once; from any thread; never raises."""
        adapter = self.adapter
        try:
            if adapter is not None:
                call_guarded(adapter.emergency_halt if emergency else adapter.halt)
        except Exception as error:  # noqa: BLE001 - the caller goes on with the next robot
            robot_log(self.name).error("its halt failed: %s", failure_text(error))
            self.halt_failed(error)

    def halt_unheard(self, reason: str, *, wait: float) -> str:
        """Have the adapter write a requested stop to a robot that does not answer.

        Returns what is known of it after ``wait`` seconds at most, for the answer to the stop.
        """
        adapter = self.adapter
        if adapter is None:
            return "the stop was not written: no link to it is open"
        outcome = "the stop may not have been written: its link has not taken it yet"

        def write() -> None:
            nonlocal outcome
            outcome = self._write_unheard(adapter, reason)

        run_in_thread(write, wait=wait)
        return outcome

    def _write_unheard(self, adapter: Adapter[Any], reason: str) -> str:
        """Write a requested stop; return what is known of it. On any thread; never raises."""
        try:
            written = call_guarded(adapter.halt_unheard, reason)
        except (CommandError, LinkError) as error:
            return f"the stop was not written: {error}"
        except Exception:  # noqa: BLE001 - logged, and told to the sender of the stop
            robot_log(self.name).exception("its halt failed")
            return "the stop may not have been written: its adapter failed"
        if written:
            return "the stop was written, but the robot does not answer"
        return "the stop was given to its adapter, which does not know whether it was written"
