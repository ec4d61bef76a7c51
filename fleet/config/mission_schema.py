"""JSON Schema of a mission for editors, with short forms, and inputs in place of values."""

from __future__ import annotations

from typing import Any

from fleet.missions.model import MissionConfig

_INPUT = "InputValue"
_FIXED = frozenset({"id", "version", "type", "event_type"})
"""Keys whose value cannot be an input."""
_ABOUT = ("title", "description", "default")
_VALUES = frozenset({"string", "number", "integer", "boolean", "array"})


def mission_schema() -> dict[str, Any]:
    """Return the schema of a mission, with its definitions under ``$defs``."""
    schema: dict[str, Any] = MissionConfig.model_json_schema(by_alias=True)
    definitions = schema["$defs"]
    for key in ("do", "undo"):
        step = definitions["StepConfig"]["properties"]
        step[key] = _with_short_acts(step[key])
    count = definitions["RoleConfig"]["properties"]["count"]
    definitions["RoleConfig"]["properties"]["count"] = {
        "anyOf": [{"type": "integer", "minimum": 1}, count],
        "description": count.get("description", ""),
    }
    for name, definition in [*definitions.items(), ("", schema)]:
        if name != "InputConfig":
            definition["properties"] = {
                key: part if key in _FIXED else _or_input(part)
                for key, part in definition["properties"].items()
            }
    definitions[_INPUT] = {
        "type": "object",
        "description": "The value of an input of the mission, as in {input: height}.",
        "properties": {"input": {"type": "string"}},
        "required": ["input"],
        "additionalProperties": False,
    }
    return schema


def _with_short_acts(part: Any) -> Any:
    """Return a schema in which an act can be a command alone."""
    if isinstance(part, list):
        return [_with_short_acts(each) for each in part]
    if not isinstance(part, dict):
        return part
    if str(part.get("$ref", "")).endswith("/ActConfig"):
        return {"anyOf": [{"type": "string", "description": "A command."}, part]}
    return {key: _with_short_acts(value) for key, value in part.items()}


def _or_input(part: dict[str, Any]) -> dict[str, Any]:
    """Return a schema in which a value, or each value of a list, can be an input."""
    reference = {"$ref": f"#/$defs/{_INPUT}"}
    about: dict[str, Any] = {key: part[key] for key in _ABOUT if key in part}
    plain = {key: value for key, value in part.items() if key not in about}
    if isinstance(plain.get("items"), dict):
        plain["items"] = _or_input(plain["items"])
    if "anyOf" in plain:
        return {**about, "anyOf": [*map(_or_input_inside, plain["anyOf"]), reference]}
    return {**about, "anyOf": [plain, reference]} if plain.get("type") in _VALUES else part


def _or_input_inside(part: dict[str, Any]) -> dict[str, Any]:
    """Return one of several alternative schemas, with inputs permitted in its lists."""
    if isinstance(part.get("items"), dict):
        return {**part, "items": _or_input(part["items"])}
    return part
