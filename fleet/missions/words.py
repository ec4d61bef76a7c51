"""Descriptions of runs as sentences for readers who do not know the grammar."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

_SERIAL = re.compile(r"\.\d+$")
PHASES: Mapping[str, str] = MappingProxyType(
    {
        "new": "is about to begin",
        "filling": "asks a spare to join before step {step}",
        "occupying": "waits for its places",
        "preparing": "prepares its robots to begin step {step} together",
        "step": "carries out step {step}",
        "waiting": "waits in step {step}",
        "asking": "asks a person in step {step}",
        "paused": "is paused in step {step}",
        "halting": "brings its robots to a standstill before it undoes what it did",
        "undoing": "undoes what it did",
        "ending": "ends: its robots are brought to a standstill, or do what on_abort says",
        "ended": "has ended",
    }
)
OUTCOMES: Mapping[str, str] = MappingProxyType(
    {
        "done": "came to the end",
        "refused": "is out of the run, because it was refused",
        "failed": "is out of the run, because it failed",
        "late": "is out of the run, because it was not done in time",
        "lost": "is out of the run, because it does not answer",
        "taken": "is out of the run, because it was taken",
        "stopped": "is out of the run, because it was stopped",
        "skipped": "was not through when the run ended",
        "unknown": "ended without being observed",
    }
)


def step_of(name: str) -> str:
    """Return the mission's name of a step, without the number that distinguishes its repetitions."""
    return _SERIAL.sub("", name)


def phase_words(phase: str, step: str) -> str:
    """Describe the phase of a run."""
    return PHASES.get(phase, phase).format(step=step_of(step))


def log_line(text: str, robot: str, step: str) -> str:
    """Return a line of a run's log as a sentence."""
    said = f"{robot} {text}" if robot else text
    return f"{said} (step {step_of(step)})" if step else said
