"""JSON Schema (2020-12) of fleet.yaml for editors, with one kind of robot per adapter."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import Field, create_model
from pydantic.errors import PydanticInvalidForJsonSchema

from fleet.config.mission_schema import mission_schema
from fleet.config.schema import FleetConfig, Sections
from fleet.plugins.registry import PluginState, Registry
from fleet.robot_config import AdapterConfig

log = logging.getLogger(__name__)

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_OWN_TO_ROBOT = ("name", "twin", "adapter")
_VARIABLE = {"type": "string", "pattern": r"\$\{"}  # ${PORT} in the view of an editor
_TYPED = ("integer", "number", "boolean")


def json_schema(registry: Registry) -> dict[str, object]:
    """Return the schema with all kinds of robots in the registry; failed adapters are left out."""
    model: object = create_model("Fleet", __base__=Sections, robots=_robots_field())
    schema: dict[str, Any] = model.model_json_schema()
    definitions = schema["$defs"]
    definitions["CloudConfig"].pop("required", None)  # the environment may give the host
    names = [_hoisted(kind, own, definitions) for kind, own in _kinds(registry)]
    if names:
        schema["properties"]["robots"]["items"] = _one_of(dict(names))
    kinds = [definitions[name] for _, name in names] or [definitions["AdapterConfig"]]
    schema["properties"]["defaults"] = _defaults(kinds, schema["properties"]["defaults"]["description"])
    for kind in kinds:  # defaults: may give the others
        kind["required"] = [key for key in _OWN_TO_ROBOT if key in kind["properties"]]
    mission = mission_schema()
    definitions |= mission.pop("$defs") | {"MissionConfig": mission}
    schema["properties"]["missions"]["additionalProperties"] = {"$ref": "#/$defs/MissionConfig"}
    schema["patternProperties"] = {"^x-": {}}
    return {"$schema": DIALECT, **_with_variables(schema)}


def mission_file_schema() -> dict[str, object]:
    """Return the schema of a file with one mission."""
    return {"$schema": DIALECT, **_with_variables(mission_schema())}


def _robots_field() -> tuple[Any, object]:
    """Return the field of the list of robots, without kinds yet."""
    described = FleetConfig.model_fields["robots"].description
    return list[AdapterConfig], Field(min_length=1, description=described)


def _kinds(registry: Registry) -> Iterable[tuple[str, dict[str, object]]]:
    """Yield each kind of robot with the schema of its config, if it can be expressed in JSON Schema."""
    for plugin in registry.load_all():
        if plugin.state is not PluginState.LOADED:
            continue
        schema = plugin.description.schema if plugin.description else _schema_of(plugin.adapter)
        if schema is None:
            log.warning("%s is left out of the schema: JSON Schema cannot say its config", plugin.name)
        else:
            yield plugin.name, schema


def _schema_of(adapter: Any) -> dict[str, object] | None:
    """Return the schema of an installed adapter's config, None if there is none."""
    try:
        schema: dict[str, object] = adapter.Config.model_json_schema()
    except PydanticInvalidForJsonSchema:
        return None
    return schema


def _hoisted(kind: str, schema: dict[str, Any], definitions: dict[str, object]) -> tuple[str, str]:
    """Move a kind's schema and its references to the definitions; return its name there.

    A definition whose name is taken by a different one is prefixed with the kind.
    """
    own = dict(schema)
    inner = own.pop("$defs", {})
    renamed = {name: f"{kind}.{name}" for name in inner if definitions.get(name, inner[name]) != inner[name]}
    for name, part in inner.items():
        definitions.setdefault(renamed.get(name, name), _referring(part, renamed))
    title = str(own.get("title", kind))
    name = f"{kind}.{title}" if title in definitions else title
    definitions[name] = _referring(own, renamed)
    return kind, name


def _referring(part: object, renamed: Mapping[str, str]) -> Any:
    """Return a schema with references to the renamed definitions."""
    if isinstance(part, list):
        return [_referring(each, renamed) for each in part]
    if not isinstance(part, dict):
        return part
    walked = {key: _referring(value, renamed) for key, value in part.items()}
    if isinstance(walked.get("$ref"), str):
        before, _, name = walked["$ref"].rpartition("/")
        walked["$ref"] = f"{before}/{renamed.get(name, name)}"
    return walked


def _one_of(names: Mapping[str, str]) -> dict[str, Any]:
    """Return the schema of a robot: the definition selected by its adapter."""
    references = {kind: f"#/$defs/{name}" for kind, name in names.items()}
    if len(references) == 1:
        return {"$ref": next(iter(references.values()))}
    return {
        "discriminator": {"mapping": references, "propertyName": "adapter"},
        "oneOf": [{"$ref": reference} for reference in references.values()],
    }


def _defaults(kinds: Iterable[dict[str, Any]], description: str) -> dict[str, Any]:
    """Return the schema of ``defaults``: the fields of every kind of robot, except those that identify it."""
    properties: dict[str, list[object]] = {}
    for kind in kinds:
        for key, value in kind["properties"].items():
            if key not in _OWN_TO_ROBOT and value not in properties.setdefault(key, []):
                properties[key].append(value)
    return {
        "type": "object",
        "description": description,
        "additionalProperties": False,
        "properties": {
            key: each[0] if len(each) == 1 else {"anyOf": each} for key, each in properties.items()
        },
    }


def _with_variables(schema: object) -> Any:
    """Return a schema in which a variable can replace any number or boolean."""
    if isinstance(schema, list):
        return [_with_variables(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    walked = {key: _with_variables(part) for key, part in schema.items()}
    if walked.get("type") not in _TYPED:
        return walked
    about = {key: walked.pop(key) for key in ("title", "description", "default") if key in walked}
    return {"anyOf": [walked, _VARIABLE], **about}
