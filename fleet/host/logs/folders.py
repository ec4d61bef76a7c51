"""Locations of the logs of an edge's processes, for ``fleet logs`` and ``fleet support``."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path

from fleet.spool.state_folder import state_folder

_SUFFIX = ".log"


def log_folder(state: Path) -> Path:
    """Return the folder of the logs in an edge's folder of persistent state."""
    return state / "log"


def show_log(edge: str, folder: Path, directory: Path) -> None:
    """Create a link in the runtime folder to the logs of an edge that runs here; never raises."""
    link = directory / f"{edge}{_SUFFIX}"
    with contextlib.suppress(OSError):
        link.unlink(missing_ok=True)
        link.symlink_to(folder.absolute(), target_is_directory=True)


def log_folders(directories: list[Path], environ: Mapping[str, str] = os.environ) -> dict[str, Path]:
    """Return the folders of all logs of this user, by edge; links in runtime folders take precedence."""
    kept = state_folder("edge", environ=environ).parent
    found = {path.name: log_folder(path) for path in sorted(kept.glob("*/"))}
    for directory in directories:
        found |= {path.name.removesuffix(_SUFFIX): path for path in directory.glob(f"*{_SUFFIX}")}
    return {edge: path for edge, path in found.items() if path.is_dir()}
