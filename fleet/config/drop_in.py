"""Robots whose adapter is a drop-in file: validated by the file's own process."""

from __future__ import annotations

import json
from collections.abc import Mapping
from uuid import UUID

import msgspec
from pydantic import ConfigDict, Field, ValidationError

from fleet.config.explain import checked
from fleet.config.problems import Mark, YamlPath
from fleet.config.yaml import Document
from fleet.plugins.probe import CheckedConfig, ConfigCase, PathSteps, ProbeError, ProblemPlace
from fleet.plugins.registry import Plugin, Registry
from fleet.robot_config import AdapterConfig


class DropInConfig(AdapterConfig):
    """The host's fields of a robot; the adapter's other fields are validated where the file is imported."""

    model_config = ConfigDict(extra="ignore")
    is_simulated: bool = Field(False, description="What its own Config says.")

    @property
    def simulated(self) -> bool:
        """True if the robot is a simulation."""
        return self.is_simulated


_DEFAULTS: Mapping[str, object] = json.loads(
    AdapterConfig(name="any", twin=UUID(int=0)).model_dump_json(exclude={"name", "twin"})
)
"""The host's fields as they are when nothing is said: robots share these values, which take 4 kB for each."""


def requested(
    registry: Registry,
    plugin: Plugin,
    data: object,
    *,
    at: YamlPath,
    document: Document,
    context: Mapping[str, object],
) -> tuple[DropInConfig, CheckedConfig] | None:
    """Return a robot validated by a drop-in file's Config; None after reporting the errors."""
    try:
        said = registry.check(plugin, _case(plugin, data, at, document, context["folder"]))
    except ProbeError as error:
        document.report(
            document.marks[at], f"the adapter {plugin.name!r} cannot be used", f"{plugin.origin}: {error}"
        )
        return None
    for flaw in said.flaws:
        document.report(Mark(*msgspec.structs.astuple(flaw.at)), flaw.message, flaw.hint)
    if not said.fields:
        return None
    try:
        fields = {key: value for key, value in json.loads(said.fields).items() if value != _DEFAULTS.get(key)}
        return checked(DropInConfig, fields | {"is_simulated": said.simulated}, context), said
    except (ValueError, ValidationError) as error:
        document.report(document.marks[at], f"what {plugin.origin} makes of it cannot be read", str(error))
        return None


def _case(plugin: Plugin, data: object, at: YamlPath, document: Document, folder: object) -> ConfigCase:
    """Return a robot with its positions in the file, without the rest of the file."""

    def within(steps: PathSteps) -> bool:
        return steps[: len(at)] == at or not steps

    def places(marks: Mapping[YamlPath, Mark]) -> tuple[tuple[PathSteps, ProblemPlace], ...]:
        return tuple(
            (steps, ProblemPlace(*msgspec.structs.astuple(mark)))
            for steps, mark in marks.items()
            if within(steps)
        )

    return ConfigCase(
        adapter=plugin.name,
        data=json.dumps(data),
        at=at,
        folder=str(folder),
        marks=places(document.marks),
        keys=places(document.keys),
        texts=tuple(filter(within, document.texts)),
        spoiled=tuple(filter(within, document.spoiled)),
    )
