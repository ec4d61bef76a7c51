"""What happens to one robot unasked: it comes and goes, its health changes, it acts by itself."""

from __future__ import annotations

from fleet.host.requests.event_reporter import EventReporter
from fleet.model.event import EventKind, Severity
from fleet.model.health import Health, Level
from fleet.model.report import FlightControllerReport, Report

_SEVERITIES = {
    Level.OK: Severity.INFO,
    Level.DEGRADED: Severity.WARNING,
    Level.OFFLINE: Severity.WARNING,
    Level.FAULT: Severity.ERROR,
}


class UnrequestedEvents:
    """One robot's; ``event_reporter`` tells them."""

    def __init__(self, event_reporter: EventReporter) -> None:
        self._event_reporter = event_reporter
        self._answers = False
        self._failsafe = False

    def level_is(self, health: Health) -> None:
        """Tell a new level of its health: that it was found, or lost, or that it is otherwise now."""
        kind, answered = EventKind.HEALTH, self._answers
        if health.level is Level.OFFLINE:
            kind, self._answers = EventKind.LOST, False
        elif health.level is not Level.FAULT:  # which it may have without anybody's reaching it
            kind, self._answers = EventKind.HEALTH if answered else EventKind.FOUND, True
        text = f"{health.level.word}: {health.cause}" if health.cause else health.level.word
        data = {"level": health.level.word, "cause": health.cause}
        self._event_reporter.event(kind, text, severity=_SEVERITIES[health.level], data=data, logs=False)

    def see(self, report: Report) -> None:
        """Tell that an autopilot has begun to act by itself."""
        if not isinstance(report, FlightControllerReport) or report.failsafe == self._failsafe:
            return
        self._failsafe = report.failsafe
        if report.failsafe:
            said = [each.text for each in report.status_texts]
            because = f": {said[-1]}" if said else ""
            text = f"the autopilot's fail-safe is active, mode {report.mode}{because}"
            data = {"mode": report.mode, "status_texts": said}
            self._event_reporter.event(EventKind.FAILSAFE, text, severity=Severity.ERROR, data=data)
