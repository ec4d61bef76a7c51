"""Recorder settings from ``record:`` in fleet.yaml, for the recorder beside its edge."""

from __future__ import annotations

from pathlib import Path

from fleet.config.programs import RecordConfig
from fleet.config.schema import FleetConfig, Sections
from fleet.host.process.component_settings import bus_settings
from fleet.record.task import FOLDER, MIB, Bounds, RecordTask
from fleet.spool.state_folder import state_folder


def folder_of(config: Sections) -> Path:
    """Return the folder of the recorder of an edge."""
    given = config.record.folder if config.record is not None else None
    return (given or state_folder(config.edge.id, config.edge.spool.path) / FOLDER).absolute()


def record_task(config: FleetConfig, wanted: RecordConfig) -> RecordTask:
    """Return the task of the recorder of an edge: it records that edge only."""
    file_size = min(64 * MIB, max(MIB, wanted.size * MIB // 16))
    age = wanted.hours * 3600
    bounds = Bounds(wanted.size * MIB, age, file_size, min(600.0, max(1.0, age / 16)), wanted.free * MIB)
    return RecordTask(str(folder_of(config)), bounds, (bus_settings(config),), only=True)
