"""Probe processes of drop-in files, shared by all tests whose files have the same text.

An edge starts a probe whenever it reads its fleet.yaml, which takes a third of a second of processor time,
and most tests of edges read the same plugin several times. ``tests/fleet/plugins`` tests the processes.
"""

import threading
from pathlib import Path

from fleet.plugins.probe import CheckedConfig, ConfigCase, DropInContent, Probe, ProbeError

KEPT = 4
"""Processes that wait for the next test with the same file."""


class SharedProbe:
    """Stands for the probe of each copy of a file; to close one of them closes nothing."""

    def __init__(self, file: Path) -> None:
        self._probe = Probe(file)
        self._lock = threading.Lock()  # two edges of a test may ask at once
        self._found: DropInContent | None = None

    def is_usable(self) -> bool:
        """Return False for a process that has ended, and for a file whose report names its folder."""
        try:
            return self._probe._process.poll() is None and not self.found().reports
        except ProbeError:
            return False

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


class SharedProbes:
    """The last few files that were inspected, by their name and text."""

    def __init__(self) -> None:
        self._probes: dict[tuple[str, str], SharedProbe] = {}

    def probe(self, path: Path) -> SharedProbe:
        """Return what a registry takes for the probe of a file."""
        of = path.name, path.read_text()
        shared = self._probes.pop(of, None)
        if shared is None or not shared.is_usable():
            if shared is not None:
                shared.end()
            shared = SharedProbe(path)
        self._probes[of] = shared  # as the last one that was used
        if len(self._probes) > KEPT:
            self._probes.pop(next(iter(self._probes))).end()
        return shared

    def end(self) -> None:
        """End all processes."""
        for shared in self._probes.values():
            shared.end()
