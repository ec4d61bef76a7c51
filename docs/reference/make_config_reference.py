"""Writes docs/reference/config.md from the models of fleet.yaml; run it after changing one.

python docs/reference/make_config_reference.py
"""  # noqa: INP001 - a script beside its result

from __future__ import annotations

import enum
import pathlib
import types
import typing
from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Literal
from uuid import UUID

from pydantic import BaseModel, SecretStr
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from fleet.config.schema import FleetConfig
from fleet.plugins.registry import GROUP, OWN_DISTRIBUTION, Registry
from fleet.robot_config import AdapterConfig

TARGET = pathlib.Path(__file__).with_name("config.md")
INTRODUCTION = """\
# fleet.yaml

Made from the models by `docs/reference/make_config_reference.py`; do not edit.

`fleet check` reports every error of a file with its line and column, and a hint. `fleet init` writes an
example; `fleet schema` prints a JSON Schema for editors.

- YAML 1.2: only `true` and `false` are booleans; `yes`, `on` and `0755` are text. A key that is there
  twice is an error, and so is an unknown one. Keys at the top that begin with `x-` are ignored.
- `!include FILE` puts another file of the same folder (or below) in its place.
- `!secret NAME` takes a value from `secrets.yaml` beside the file: lines `name: value`, mode 0600.
- `${VAR}` is an environment variable, `${VAR:-default}` one with a default, `${VAR:?message}` one that
  must be set; `$$` is a dollar. Inside `{...}` and `[...]` write it in quotes.
- `defaults:` is merged into every robot, mapping by mapping; a key of the robot itself has precedence. It
  cannot give `name`, `twin` or `adapter`.
- Paths are relative to the folder of the file.
"""
_WORDS: dict[Any, str] = {
    str: "text",
    int: "whole number",
    float: "number",
    bool: "`true` or `false`",
    UUID: "uuid",
    pathlib.Path: "path",
    SecretStr: "text, never shown",
    Any: "anything",
}
_SHAPES: dict[Any, str] = {
    typing.Annotated: "{0}",
    types.UnionType: "{0}",
    typing.Union: "{0}",
    tuple: "list of {0}",
    list: "list of {0}",
    frozenset: "list of {0}",
    dict: "mapping of {1} to {2}",
}
_BOUNDS = {"gt": "more than", "ge": "at least", "lt": "less than", "le": "at most"}


def kind(annotation: Any) -> str:
    """Return the type of a field and its allowed values, in words."""
    arguments = [each for each in typing.get_args(annotation) if each not in (types.NoneType, ...)]
    origin = typing.get_origin(annotation)
    if origin is Literal:
        return ", ".join(f"`{value}`" for value in arguments)
    inner = [kind(each) for each in arguments if origin is not typing.Annotated or each is arguments[0]]
    if origin in _SHAPES:
        return _SHAPES[origin].format(" or ".join(dict.fromkeys(inner)), *inner)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return f"[{annotation.__name__}](#{annotation.__name__.lower()})"
    return _WORDS.get(annotation, getattr(annotation, "__name__", str(annotation)))


def bounds(field: FieldInfo) -> str:
    """Return the limits of a number, in words."""
    parts = [
        *field.metadata,
        *(part for each in typing.get_args(field.annotation) for part in _metadata(each)),
    ]
    words = [
        f"{word} {getattr(part, name):g}"
        for part in parts
        for name, word in _BOUNDS.items()
        if hasattr(part, name)
    ]
    return f", {' and '.join(words)}" if words else ""


def _metadata(annotation: Any) -> tuple[Any, ...]:
    found = getattr(annotation, "__metadata__", ())
    return tuple(inner for each in found for inner in getattr(each, "metadata", (each,)))


def default(field: FieldInfo) -> str:
    """Return a field's default as it is written in YAML."""
    value = field.get_default(call_default_factory=True)
    if isinstance(value, tuple) and value and all(isinstance(each, enum.Enum) for each in value):
        return f"`[{', '.join(each.value for each in value)}]`"
    if value is PydanticUndefined:
        return "**required**"
    if value is None or isinstance(value, BaseModel) or value in ((), {}, "", frozenset()):
        return ""
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def table(model: type[BaseModel], without: frozenset[str] = frozenset()) -> Iterator[str]:
    """Yield the table of a model's fields."""
    yield "| key | type, allowed values | default | |"
    yield "|---|---|---|---|"
    for name, field in model.model_fields.items():
        if name not in without:
            key, what = field.alias or name, f"{kind(field.annotation)}{bounds(field)}"
            yield f"| `{key}` | {what} | {default(field)} | {field.description or 'Picks this adapter.'} |"


def models_in(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """Yield the models in the fields of a model, depth first, each where it is met first."""
    stack: list[Any] = [field.annotation for field in model.model_fields.values()]
    while stack:
        annotation = stack.pop(0)
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield annotation
            yield from models_in(annotation)
        stack[:0] = typing.get_args(annotation)


def section(
    title: str, model: type[BaseModel], without: frozenset[str] = frozenset(), level: int = 2
) -> Iterator[str]:
    """Yield the section of a model: title, what it is, table."""
    summary = (model.__doc__ or "").strip().splitlines()[0]
    yield from ("", f"{'#' * level} {title}", "", summary, "", *table(model, without))


def own_entry_points() -> list[EntryPoint]:
    """Return the adapters that this project installs."""
    found = entry_points(group=GROUP)
    return [point for point in found if point.dist is not None and point.dist.name == OWN_DISTRIBUTION]


def render() -> str:
    """Return the whole reference; every adapter of this project has its section, no other that is installed.

    Raises RuntimeError for an adapter that cannot be loaded.
    """
    lines = [INTRODUCTION.rstrip(), *section("The whole file", FleetConfig)]
    for model in dict.fromkeys(models_in(FleetConfig)):
        lines += section(model.__name__, model)
    known = set(models_in(FleetConfig))
    for plugin in Registry(own_entry_points()).load_all():
        if plugin.adapter is None:
            raise RuntimeError(f"{plugin.name}: {plugin.report}")
        config = plugin.adapter.Config
        inherited = frozenset(AdapterConfig.model_fields)
        lines += section(f"adapter: {plugin.name}", config, inherited)
        for model in dict.fromkeys(models_in(config)):
            if model not in known:
                known.add(model)
                lines += section(model.__name__, model, level=3)
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    TARGET.write_text(render(), encoding="utf-8")
