"""Regression tests from recordings: replay the frames of a robot through its adapter."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fleet.adapter import AnyAdapter
from fleet.replay.differences import Difference
from fleet.replay.file import load_recording, replay_robot
from fleet.robot_config import AdapterConfig


def differences_from(
    path: str | Path, adapter: type[AnyAdapter], config: AdapterConfig | Mapping[str, Any]
) -> list[Difference]:
    """Return the differences between an adapter's reports and the recorded ones; empty if there are none.

    ``path`` is a file of ``fleet record``; ``config`` is the robot's entry in fleet.yaml. Call it where no
    event loop runs. Raises Refused if there is nothing to compare, StateError for a file without messages.
    """
    made = config if isinstance(config, AdapterConfig) else adapter.Config.model_validate(config)
    return list(replay_robot(load_recording(Path(path)), adapter, made).found)
