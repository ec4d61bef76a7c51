"""Probe process of drop-in files, shared by all tests whose files have the same text.

An edge starts a probe whenever it reads its fleet.yaml, which takes a sixth of a second of processor time,
and most tests of edges read the same plugin several times. ``tests/fleet/plugins`` tests the processes.
"""

import threading
from pathlib import Path

from fleet.plugins.probe import CheckedConfig, ConfigCase, DropInContent, Probe


class SharedProbe:
    """Stands for the probe of each copy of a file; to close one of them closes nothing."""

    def __init__(self, file: Path) -> None:
        self._probe = Probe(file)
        self._text = file.read_text()
        self._lock = threading.Lock()  # two edges of a test may ask at once
        self._found: DropInContent | None = None

    def probe(self, path: Path) -> "Probe | SharedProbe":
        """Return what a registry takes for the probe of a file: one of its own for any other text."""
        return self if path.read_text() == self._text else Probe(path)

    def found(self) -> DropInContent:
        """Return what the file has."""
        with self._lock:
            if self._found is None:
                self._found = self._probe.found()
            return self._found

    def check(self, case: ConfigCase) -> CheckedConfig:
        """Return what the file makes of a robot's config."""
        self.found()
        with self._lock:
            return self._probe.check(case)

    def close(self) -> None:
        """Keep the process for the next test."""

    def end(self) -> None:
        """End the process."""
        self._probe.close()
