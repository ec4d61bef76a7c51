"""fleet.yaml's ``notify``: targets that are informed of faults and stops."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Self

from pydantic import Field, SecretStr, model_validator

from fleet.model.event import EventKind
from fleet.robot_config import Name
from fleet.yaml_model import Model, wrong

DEFAULT_EVENTS = (
    EventKind.STOP,
    EventKind.EMERGENCY_STOP,
    EventKind.RELEASE,
    EventKind.AUTHORITY_LOST,
    EventKind.LOST,
    EventKind.FAILSAFE,
    EventKind.FENCE,
)


class NotifyConfig(Model):
    """A webhook or program that is informed of faults and stops; nothing waits for it."""

    url: SecretStr | None = Field(
        None,
        description="http or https; each notice is posted as JSON. Use !secret: it may hold a key.",
    )
    command: tuple[str, ...] = Field(
        (), description="A program and its arguments; each notice is JSON on its stdin. No shell."
    )
    events: tuple[EventKind, ...] = Field(
        DEFAULT_EVENTS,
        description="Kinds of events, as `fleet history` names them; errors are always included.",
    )
    robots: tuple[Name, ...] = Field((), description="Only of these robots and groups. None: all.")
    timeout: float = Field(5.0, gt=0, le=60, description="Timeout of each of three tries, in seconds.")
    per_minute: int = Field(
        12,
        ge=1,
        le=600,
        description="Limit of notices per minute; the number of suppressed ones is reported.",
    )

    @property
    def what(self) -> str:
        """Return its kind in one word."""
        return "webhook" if self.url is not None else "program"

    @model_validator(mode="after")
    def _one_target(self) -> Self:
        if (self.url is None) == (not self.command):
            raise wrong("url", "one of url and command is needed")
        if self.url is not None and not self.url.get_secret_value().startswith(("http://", "https://")):
            raise wrong("url", "must begin with http:// or https://")
        return self


def with_members(
    configs: Iterable[NotifyConfig], groups: Mapping[str, tuple[str, ...]]
) -> tuple[NotifyConfig, ...]:
    """Return the targets with groups replaced by their robots."""
    return tuple(
        each.model_copy(
            update={"robots": tuple(robot for name in each.robots for robot in groups.get(name, (name,)))}
        )
        for each in configs
    )
