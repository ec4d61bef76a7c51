"""Causes of fail-safes and of position problems, as text."""

from __future__ import annotations

import re
from collections.abc import Iterable

from fleet_mavlink.state import VehicleState
from fleet_mavlink.statustext import WARNING, Sentence

_BEFORE = 3.0  # s before a fail-safe, or its change of mode, in which texts may contain its reason
_AFTER = 0.8  # s after it: ArduPilot sends the reason after the mode
_MOST = 4  # texts
_OVER = re.compile(r"\b(cleared|recovered)\b", re.IGNORECASE)
_ASIDE = re.compile(
    r"lane switch|primary changed|not available|not possible|requires position", re.IGNORECASE
)
_NEEDED = (
    (0x01, "attitude"),
    (0x02, "horizontal velocity"),
    (0x10, "position"),
    (0x20, "height"),
)
"""Estimator flags common to ArduPilot and PX4, and the estimate that is missing without them."""


def cause(said: Iterable[Sentence], since: float, until: float) -> str:
    """Return the warning texts between two times as one reason, empty without any.

    Texts about the end of a problem or its consequences are left out, and beginnings of longer texts.
    """
    texts = [
        each.text
        for each in said
        if each.severity <= WARNING
        and since <= each.at <= until
        and not _OVER.search(each.text)
        and not _ASIDE.search(each.text)
    ]
    fullest = [text for text in dict.fromkeys(texts) if not _is_said_by_another(text, texts)]
    return "; ".join(fullest[-_MOST:])


def _is_said_by_another(text: str, texts: list[str]) -> bool:
    """Return True if another, longer text starts with this one."""
    return any(other != text and other.startswith(text) for other in texts)


class FailsafeCause:
    """Reason of the current fail-safe; ``text`` is empty without a fail-safe or without a reason."""

    def __init__(self) -> None:
        self.text = ""
        self._mode = ""
        self._since: float | None = None

    def observe(self, state: VehicleState, mode: str, said: Iterable[Sentence], now: float) -> None:
        """Update from the newest state and the received texts."""
        changed, self._mode = mode != self._mode, mode
        if not state.failsafe:
            self.text, self._since = "", None
            return
        if self._since is None or changed:
            self._since = now
        if now - self._since <= _AFTER:
            self.text = cause(said, self._since - _BEFORE, now) or self.text

    def settled(self, now: float) -> bool:
        """Return True once no further texts about the reason are expected."""
        return self._since is None or now - self._since > _AFTER


def position_troubles(state: VehicleState, now: float) -> tuple[str, ...]:
    """Return the problems of the position, as text; only for estimates that it had since its start."""
    troubles = []
    if state.had_fix and state.fix_now(now) is None:
        satellites = "" if state.satellites is None else f" ({state.satellites} satellites)"
        troubles.append(f"no satellite fix{satellites}")
    if state.had_estimate and state.estimator_has_position is False:
        flags = state.estimator_flags or 0
        missing = ", ".join(word for bit, word in _NEEDED if not flags & bit)
        troubles.append(f"its estimator lost {missing}: its reported position is not reliable")
    return tuple(troubles)
