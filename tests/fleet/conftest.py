"""Probe processes of drop-in files that tests share."""

import pytest

from fleet.plugins import registry
from tests.tools.shared_probe import SharedProbes


@pytest.fixture(scope="session")
def kept_probes():
    """Keep the processes of the last few drop-in files, by their text."""
    kept = SharedProbes()
    yield kept
    kept.end()


@pytest.fixture
def shared_probes(monkeypatch, kept_probes):
    """Ask one process about all copies of a drop-in file: each takes half a second of processor time."""
    monkeypatch.setattr(registry, "Probe", kept_probes.probe)
