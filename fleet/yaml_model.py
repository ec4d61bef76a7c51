"""Base class of the models of fleet.yaml; types of paths and durations."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError


class Model(BaseModel):
    """Frozen model that refuses unknown keys and numbers that are not finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def wrong(key: str, reason: str) -> PydanticCustomError:
    """Return an error of a whole model, reported at the line of one of its keys."""
    return PydanticCustomError("value_error", "{reason}", {"reason": reason, "key": key})


def _beside(path: Path, info: ValidationInfo) -> Path:
    """Resolve a path relative to the folder of fleet.yaml or to the user's home."""
    folder: Path = (info.context or {}).get("folder", Path())
    return folder / path.expanduser()


def _existing(path: Path) -> Path:
    """Refuse a path that does not exist."""
    if not path.exists():
        raise ValueError(f"there is no {path}")
    return path


_DURATION = re.compile(r"(\d+(?:\.\d+)?) ?(s|min|h)")
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}
LONGEST = 86_400.0  # s; longest duration


def _seconds(given: Any) -> Any:
    """Convert ``60 s``, ``12 min`` or ``1 h`` to seconds; return other values unchanged."""
    if not isinstance(given, str):
        return given
    match = _DURATION.fullmatch(given.strip())
    if match is None:
        raise ValueError(f"{given!r} is no duration: write 60 s, 12 min or 1 h")
    return float(match[1]) * _SECONDS[match[2]]


Duration = Annotated[
    float,
    BeforeValidator(_seconds),
    Field(gt=0, le=LONGEST, allow_inf_nan=False),
    WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string", "pattern": f"^{_DURATION.pattern}$"}]}),
]
"""A duration in seconds; written as a number, or as in ``12 min``."""
NewPath = Annotated[Path, AfterValidator(_beside)]
"""A path relative to the folder of fleet.yaml; it need not exist."""
ExistingPath = Annotated[NewPath, AfterValidator(_existing)]
"""A path relative to the folder of fleet.yaml that must exist."""
