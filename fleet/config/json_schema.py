"""The JSON Schema (2020-12) of fleet.yaml, as editors want it: one kind of robot for each adapter."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from typing import Annotated, Any, Union

from pydantic import Field, create_model
from pydantic.errors import PydanticInvalidForJsonSchema

from fleet.config.schema import FleetConfig, Sections
from fleet.registry import Registry
from fleet.robot_config import AdapterConfig

log = logging.getLogger(__name__)

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_OWN_TO_ROBOT = ("name", "twin", "adapter")
_VARIABLE = {"type": "string", "pattern": r"\$\{"}  # what ${PORT} is to an editor
_TYPED = ("integer", "number", "boolean")


def json_schema(registry: Registry) -> dict[str, Any]:
    """Return the schema; every adapter of the registry is imported, those that fail are left out."""
    plugins = registry.load_all()
    configs = [plugin.adapter.Config for plugin in plugins if plugin.adapter is not None]
    usable = [config for config in configs if _has_schema(config)]
    described = FleetConfig.model_fields["robots"].description
    robots: Any = list[_one_of(usable)]  # type: ignore[misc]  # made at run time
    model: Any = create_model(
        "Fleet", __base__=Sections, robots=(robots, Field(min_length=1, description=described))
    )
    schema: dict[str, Any] = model.model_json_schema()
    definitions = schema["$defs"]
    definitions["CloudConfig"].pop("required", None)  # the environment may give the host
    kinds = [definitions[name] for name in _names_of(schema["properties"]["robots"]["items"])]
    schema["properties"]["defaults"] = _defaults(kinds, schema["properties"]["defaults"]["description"])
    for kind in kinds:  # the rest may stand in defaults:
        kind["required"] = [key for key in _OWN_TO_ROBOT if key in kind["properties"]]
    schema["patternProperties"] = {"^x-": {}}
    return {"$schema": DIALECT, **_with_variables(schema)}


def _has_schema(config: type[AdapterConfig]) -> bool:
    """Return True when a config can be said in JSON Schema."""
    try:
        config.model_json_schema()
    except PydanticInvalidForJsonSchema as error:
        log.warning("%s is left out of the schema: %s", config.__name__, error)
        return False
    return True


def _one_of(configs: list[type[AdapterConfig]]) -> Any:
    """Return the type of a robot: the config that its adapter names."""
    if len(configs) < 2:
        return configs[0] if configs else AdapterConfig
    return Annotated[Union[tuple(configs)], Field(discriminator="adapter")]  # noqa: UP007 - made at run time


def _names_of(items: dict[str, Any]) -> list[str]:
    """Return the definitions that a robot may be."""
    references = items.get("oneOf", [items])
    return [reference["$ref"].rpartition("/")[2] for reference in references]


def _defaults(kinds: Iterable[dict[str, Any]], description: str) -> dict[str, Any]:
    """Return the schema of ``defaults``: whatever some kind of robot may have, but its own three keys."""
    properties: dict[str, list[Any]] = {}
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


def _with_variables(schema: Any) -> Any:
    """Return a schema in which a variable may stand for any number or boolean."""
    if isinstance(schema, list):
        return [_with_variables(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    walked = {key: _with_variables(part) for key, part in schema.items()}
    if walked.get("type") not in _TYPED:
        return walked
    about = {key: walked.pop(key) for key in ("title", "description", "default") if key in walked}
    return {"anyOf": [walked, _VARIABLE], **about}
