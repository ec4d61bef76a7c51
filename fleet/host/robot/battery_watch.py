"""Battery policy of one robot: reports a low battery, acts on it, and refuses tasks beyond the reserve."""

from __future__ import annotations

from collections.abc import Callable

from fleet.host.requests.event_reporter import EventReporter
from fleet.host.requests.receipt import Receipt
from fleet.host.safety.battery_reserve import BatteryReserve
from fleet.model.command import Command, Origin, Reply, Transport
from fleet.model.event import EventKind, Severity
from fleet.robot_config import BatteryPolicy

BATTERY = Origin(Transport.MISSION, session="battery")
"""Sender of the commands that a battery policy gives."""


class BatteryWatch:
    """Battery watch of one robot.

    ``event_reporter`` reports events; ``request`` sends a command to the robot; ``free`` returns whether no
    other party controls it and no stop or landing is in progress. ``forced`` is the policy's action until
    the battery is charged; empty without one.
    """

    def __init__(
        self,
        policy: BatteryPolicy,
        *,
        event_reporter: EventReporter,
        request: Callable[[Command, Receipt], None],
        free: Callable[[], bool],
    ) -> None:
        self._reserve = BatteryReserve(policy.reserve, policy.low, policy.endurance)
        self._action = policy.action
        self._event_reporter = event_reporter
        self._request = request
        self._free = free
        self._percent: float | None = None
        self._low_reported = self._acted = False
        self.forced = self._failure = ""

    def observe(self, percent: float | None) -> None:
        """Report a low battery once and act once the robot is free; again after it was charged."""
        self._percent = percent
        if percent is None:
            return
        if self._reserve.is_charged(percent):
            self._low_reported = self._acted = False
            self.forced = self._failure = ""
        if not self._reserve.is_low(percent):
            return
        if not self._low_reported:
            self._low_reported = True
            text, policy = (
                f"its battery is low: {percent:.0f} %",
                {"percent": percent, "action": self._action},
            )
            self._event_reporter.event(EventKind.BATTERY, text, telemetry="battery_low", data=policy)
        if self._action != "warn" and not self._acted and self._free():
            receipt = Receipt(self._action, lambda _: None)
            self._request(Command(self._action, origin=BATTERY), receipt)
            self._acted = receipt.ended is None  # refused at once: retried with the next report
            self.forced = f"{self._action} by battery_policy: the battery was at {percent:.0f} %"
            if self._acted:
                done = {"percent": percent, "action": self._action}
                self._event_reporter.event(EventKind.BATTERY, self.forced, data=done)
            receipt.watch(self._ended)

    def _ended(self, reply: Reply) -> None:
        """Record that the policy's action failed."""
        if reply.done is False and self.forced:
            self.forced = f"{self._action} by battery_policy failed: {reply.reason}"
            if self.forced == self._failure:  # refused again at the next report of the battery
                return
            self._failure = self.forced
            failed = {"action": self._action, "reason": reply.reason}
            self._event_reporter.event(EventKind.BATTERY, self.forced, severity=Severity.ERROR, data=failed)

    def start_trouble(self) -> str:
        """Return why a flight may not start; empty when it may."""
        return self._reserve.start_trouble(self._percent)

    def trouble(self, metres: float = 0.0, speed: float | None = None) -> str:
        """Return why a path of ``metres``, there and home at ``speed`` m/s, may not start; else empty."""
        return self._reserve.trouble(self._percent, metres, speed)
