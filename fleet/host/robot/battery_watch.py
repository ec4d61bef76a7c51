"""A robot's low battery is told and acted upon, and what the battery cannot carry is not begun."""

from __future__ import annotations

from collections.abc import Callable

from fleet.host.requests.event_reporter import EventReporter
from fleet.host.requests.receipt import Receipt
from fleet.host.safety.battery_reserve import BatteryReserve
from fleet.model.command import Command, Origin, Reply, Transport
from fleet.model.event import EventKind, Severity
from fleet.robot_config import BatteryPolicy

BATTERY = Origin(Transport.MISSION, session="battery")
"""Who asks for what a battery policy does."""


class BatteryWatch:
    """One robot's battery, by its policy.

    ``event_reporter`` tells what happened; ``ask`` sends the robot a command of ours; ``free``
    tells whether nobody else has it, and nothing makes it safer already. ``forced`` says what was done with
    the robot because of its battery, until that was charged; empty while nothing was.
    """

    def __init__(
        self,
        policy: BatteryPolicy,
        *,
        event_reporter: EventReporter,
        ask: Callable[[Command, Receipt], None],
        free: Callable[[], bool],
    ) -> None:
        self._reserve = BatteryReserve(policy.reserve, policy.low, policy.endurance)
        self._action = policy.action
        self._event_reporter = event_reporter
        self._ask = ask
        self._free = free
        self._percent: float | None = None
        self._told_low = self._acted = False
        self.forced = ""

    def see(self, percent: float | None) -> None:
        """Tell once of a low battery, and act on it once the robot is free; again after it was charged."""
        self._percent = percent
        if percent is None:
            return
        if self._reserve.is_charged(percent):
            self._told_low = self._acted = False
            self.forced = ""
        if not self._reserve.is_low(percent):
            return
        if not self._told_low:
            self._told_low = True
            text, policy = (
                f"its battery is low: {percent:.0f} %",
                {"percent": percent, "action": self._action},
            )
            self._event_reporter.event(EventKind.BATTERY, text, telemetry="battery_low", data=policy)
        if self._action != "warn" and not self._acted and self._free():
            receipt = Receipt(self._action, lambda _: None)
            self._ask(Command(self._action, origin=BATTERY), receipt)
            self._acted = receipt.ended is None  # else it was refused at once: it is asked again
            self.forced = f"{self._action} by battery_policy: the battery was at {percent:.0f} %"
            if self._acted:
                done = {"percent": percent, "action": self._action}
                self._event_reporter.event(EventKind.BATTERY, self.forced, data=done)
            receipt.watch(self._ended)

    def _ended(self, reply: Reply) -> None:
        """Note that what was done about the battery failed."""
        if reply.done is False and self.forced:
            self.forced = f"{self._action} by battery_policy failed: {reply.reason}"
            failed = {"action": self._action, "reason": reply.reason}
            self._event_reporter.event(EventKind.BATTERY, self.forced, severity=Severity.ERROR, data=failed)

    def start_trouble(self) -> str:
        """Return why a flight may not begin; empty: it may."""
        return self._reserve.start_trouble(self._percent)

    def trouble(self, metres: float = 0.0, speed: float | None = None) -> str:
        """Return why a way of ``metres`` (there and home, at ``speed`` m/s) may not begin; empty: it may."""
        return self._reserve.trouble(self._percent, metres, speed)
