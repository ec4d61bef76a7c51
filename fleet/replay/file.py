"""Replay of a recording on disk through the adapters of robots."""

from __future__ import annotations

from pathlib import Path

import msgspec

from fleet.adapter import AnyAdapter
from fleet.errors import Refused, StateError
from fleet.record.reading import read_recording
from fleet.replay.recorded_robot import Recording, recording_of
from fleet.replay.through import Replayed, replay
from fleet.robot_config import AdapterConfig


def load_recording(path: Path) -> Recording:
    """Read a file or folder; raises StateError if it is empty or damaged."""
    try:
        return recording_of(read_recording(path))
    except (msgspec.DecodeError, ValueError, IndexError) as error:
        raise StateError(f"{path} cannot be replayed: {error}") from None


def replay_robot(recording: Recording, plugin: type[AnyAdapter], config: AdapterConfig) -> Replayed:
    """Feed the frames of one robot to its adapter; raises Refused if frames or reports are missing."""
    links = [str(getattr(config, "link", "")), *getattr(config, "backup_links", ())]
    edges = {edge for edge, name in recording.reports if name == config.name}
    if len(edges) != 1:
        known = ", ".join(f"{edge}/{name}" for edge, name in recording.robots) or "none"
        what = "several robots" if edges else "no reports of a robot"
        raise Refused(f"the recording has {what} {config.name!r}", hint=f"it has frames of: {known}")
    found = replay(plugin, config, recording.robot(edges.pop(), config.name, links))
    if not found.compared:
        raise Refused(f"the recording has no reports of {config.name} that its frames could be compared with")
    return found
