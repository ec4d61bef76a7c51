"""Calibration of a simulated compass, with the messages of ArduPilot, or the texts of PX4."""

from __future__ import annotations

from typing import Protocol

from pymavlink.dialects.v20 import all as mav

_LASTS = 20.0  # s
_REPORT_INTERVAL = 0.5  # s
_SUCCESS = int(mav.MAG_CAL_SUCCESS)
_FAILED = int(mav.MAG_CAL_FAILED)


class TextSender(Protocol):
    """Sender of texts: the autopilot."""

    def say(self, severity: int, text: str) -> None:
        """Send a STATUSTEXT."""


class SimCompass:
    """One calibration at a time; ``words``: reported in texts (PX4), not in messages of its own."""

    def __init__(self, *, words: bool) -> None:
        self.words = words
        self._began: float | None = None
        self._reported_at = 0.0

    @property
    def calibrating(self) -> bool:
        """True while a calibration runs."""
        return self._began is not None

    def start(self, now: float, speaker: TextSender) -> None:
        """Begin a calibration."""
        self._began = self._reported_at = now
        if self.words:
            speaker.say(6, "[cal] calibration started: 2 mag")

    def cancel(self, speaker: TextSender) -> None:
        """End without a result; ArduPilot sends nothing then."""
        if self.words and self.calibrating:
            speaker.say(2, "[cal] calibration cancelled")
        self._began = None

    def tick(self, now: float, speaker: TextSender, *, fails: bool) -> list[object]:
        """Report the progress, and the result."""
        if self._began is None or now - self._reported_at < _REPORT_INTERVAL:
            return []
        self._reported_at = now
        percent = int(100 * (now - self._began) / _LASTS)
        if percent < 100:
            return self._progress(percent, speaker)
        self._began = None
        return self._end(speaker, fails=fails)

    def _progress(self, percent: int, speaker: TextSender) -> list[object]:
        """Report percent."""
        if self.words:
            speaker.say(6, f"[cal] progress <{percent}>")
            return []
        return [mav.MAVLink_mag_cal_progress_message(0, 1, 3, 1, percent, [0] * 10, 0.0, 0.0, 0.0)]

    def _end(self, speaker: TextSender, *, fails: bool) -> list[object]:
        """Report the result."""
        if self.words:
            speaker.say(
                *((2, "[cal] calibration failed: timeout") if fails else (6, "[cal] calibration done: mag"))
            )
            return []
        status = _FAILED if fails else _SUCCESS
        zeros = [0.0] * 9
        return [mav.MAVLink_mag_cal_report_message(0, 1, status, int(not fails), 6.5, *zeros)]
