"""Events of one robot without a request: connected, lost, changed health, fail-safe of the autopilot."""

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
    """Unrequested events of one robot, reported by its ``event_reporter``."""

    def __init__(self, event_reporter: EventReporter) -> None:
        self._event_reporter = event_reporter
        self._answers = False
        self._failsafe = False

    def report_level(self, health: Health) -> None:
        """Report a new health level: the robot was found, was lost, or changed."""
        kind, answered = EventKind.HEALTH, self._answers
        if health.level is Level.OFFLINE:
            kind, self._answers = EventKind.LOST, False
        elif health.level is not Level.FAULT:  # a fault may be known without a connection
            kind, self._answers = EventKind.HEALTH if answered else EventKind.FOUND, True
        text = f"{health.level.word}: {health.cause}" if health.cause else health.level.word
        data = {"level": health.level.word, "cause": health.cause}
        self._event_reporter.event(kind, text, severity=_SEVERITIES[health.level], data=data, logs=False)

    def observe(self, report: Report) -> None:
        """Report that an autopilot's own fail-safe became active."""
        if not isinstance(report, FlightControllerReport) or report.failsafe == self._failsafe:
            return
        self._failsafe = report.failsafe
        if report.failsafe:
            said = [each.text for each in report.status_texts]
            because = f": {said[-1]}" if said else ""
            text = f"the autopilot's fail-safe is active, mode {report.mode}{because}"
            data = {"mode": report.mode, "status_texts": said}
            self._event_reporter.event(EventKind.FAILSAFE, text, severity=Severity.ERROR, data=data)
