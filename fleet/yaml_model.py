"""The base of every model of fleet.yaml, and paths as they stand in it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationInfo
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


NewPath = Annotated[Path, AfterValidator(_beside)]
"""A path as seen from the folder of fleet.yaml; it need not exist."""
ExistingPath = Annotated[NewPath, AfterValidator(_existing)]
"""The same; it must exist."""
