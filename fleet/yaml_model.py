"""The base of every model of fleet.yaml, and paths as they stand in it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo
from pydantic_core import PydanticCustomError


class Model(BaseModel):
    """Frozen, strict about keys and numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def wrong(key: str, reason: str) -> PydanticCustomError:
    """Return the error of a model as a whole, to be told at the line of one of its keys."""
    return PydanticCustomError("value_error", "{reason}", {"reason": reason, "key": key})


def _beside(path: Path, info: ValidationInfo) -> Path:
    """Take a path as seen from the folder of fleet.yaml, or from the user's home."""
    folder: Path = (info.context or {}).get("folder", Path())
    return folder / path.expanduser()


def _existing(path: Path) -> Path:
    """Refuse a path at which there is nothing."""
    if not path.exists():
        raise ValueError(f"there is no {path}")
    return path


_DURATION = re.compile(r"(\d+(?:\.\d+)?) ?(s|min|h)")
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}
_LONGEST = 86_400.0  # s


def _seconds(given: Any) -> Any:
    """Return the seconds of ``60 s``, ``12 min`` or ``1 h``; anything else as it is."""
    if not isinstance(given, str):
        return given
    match = _DURATION.fullmatch(given.strip())
    if match is None:
        raise ValueError(f"{given!r} is no duration: write 60 s, 12 min or 1 h")
    return float(match[1]) * _SECONDS[match[2]]


Duration = Annotated[float, BeforeValidator(_seconds), Field(gt=0, le=_LONGEST, allow_inf_nan=False)]
"""A length of time, in seconds; written as a number, or as in ``12 min``."""
NewPath = Annotated[Path, AfterValidator(_beside)]
"""A path as seen from the folder of fleet.yaml; it need not exist."""
ExistingPath = Annotated[NewPath, AfterValidator(_existing)]
"""The same; it must exist."""
