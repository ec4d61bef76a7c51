"""A regression test made of a recording: what an adapter makes of the frames that a robot sent once."""

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
    """Return what an adapter reports otherwise than was recorded; empty when all is as it was.

    ``path``: a file of ``fleet record``; ``config``: the robot's entry of fleet.yaml. It must be called where
    no event loop runs. Raises Refused when there is nothing to compare, StateError for a file without
    messages.
    """
    made = config if isinstance(config, AdapterConfig) else adapter.Config.model_validate(config)
    return list(replay_robot(load_recording(Path(path)), adapter, made).found)
