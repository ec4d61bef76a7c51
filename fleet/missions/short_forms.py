"""Expansion of short forms of a mission to the long forms of the models, and of inputs to values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def normalised(mission: Any, values: Mapping[str, Any]) -> Any:
    """Return a mission's data with expanded short forms and with ``values`` for its inputs.

    It never fails: malformed parts stay unchanged, and the models refuse them. Inputs without a value stay
    too.
    """
    data = _filled(mission, values)
    if not isinstance(data, dict):
        return data
    roles = data.get("roles")
    if isinstance(roles, dict):
        data["roles"] = {name: _counted(role) for name, role in roles.items()}
    if isinstance(data.get("steps"), list):
        data["steps"] = [_spelt_out(step) for step in data["steps"]]
    return data


def _filled(value: Any, values: Mapping[str, Any]) -> Any:
    """Return data with ``{input: NAME}`` replaced by values."""
    if isinstance(value, dict):
        if set(value) == {"input"} and isinstance(value["input"], str) and value["input"] in values:
            return values[value["input"]]
        return {key: _filled(each, values) for key, each in value.items()}
    return [_filled(each, values) for each in value] if isinstance(value, list) else value


def _counted(role: Any) -> Any:
    """Return a role with a numeric count expanded to bounds."""
    if isinstance(role, dict) and isinstance(role.get("count"), int) and role["count"] is not True:
        return {**role, "count": {"min": role["count"], "max": role["count"]}}
    return role


def _spelt_out(step: Any) -> Any:
    """Return a step with ``eye: land`` expanded to ``eye: {command: land}``, also in repeated steps."""
    if not isinstance(step, dict):
        return step
    long = dict(step)
    for key in ("do", "undo"):
        if isinstance(long.get(key), dict):
            long[key] = {
                role: {"command": act} if isinstance(act, str) else act for role, act in long[key].items()
            }
    repeat = long.get("repeat")
    if isinstance(repeat, dict) and isinstance(repeat.get("steps"), list):
        long["repeat"] = {**repeat, "steps": [_spelt_out(each) for each in repeat["steps"]]}
    return long
