"""The base of every model of fleet.yaml."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict
from pydantic_core import PydanticCustomError


class Model(BaseModel):
    """Frozen, strict about keys and numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def wrong(key: str, reason: str) -> PydanticCustomError:
    """Return the error of a model as a whole, to be told at the line of one of its keys."""
    return PydanticCustomError("value_error", "{reason}", {"reason": reason, "key": key})
