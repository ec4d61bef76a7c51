"""Reading of a YAML file into a validated section; errors name the file and the place."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TypeVar

import yaml
from pydantic import ValidationError
from pydantic_core import ErrorDetails
from yaml.constructor import ConstructorError

from fleet import ConfigError
from fleet_quadruped.robot.parts import Section

SectionT = TypeVar("SectionT", bound=Section)


class _Strict(yaml.SafeLoader):
    """YAML loader that refuses duplicate keys, where SafeLoader would silently keep the last one."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[object, object]:  # noqa: FBT001, FBT002 - signature of the base class
        """Return a mapping; raises ConstructorError for a duplicate key."""
        seen: set[str] = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                raise ConstructorError(None, None, f"the key {key.value!r} is there twice", key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def read_tree(path: Path) -> object:
    """Return the content of a YAML file; raises ConfigError."""
    try:
        return yaml.load(path.read_text(encoding="utf-8"), _Strict)  # noqa: S506 - derived from SafeLoader
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        place = getattr(error, "problem_mark", None)
        where = f"{path}:{place.line + 1}" if place else str(path)
        raise ConfigError(f"{where}: {getattr(error, 'problem', None) or 'is not UTF-8 text'}") from None


def checked(path: Path, tree: object, kind: type[SectionT]) -> SectionT:
    """Return a tree as a section; raises ConfigError with all problems and their places."""
    try:
        return kind.model_validate(tree)
    except ValidationError as error:
        known = _names(kind)
        problems = [_problem_text(problem, known) for problem in error.errors()]
        raise ConfigError(f"{path}: {'; '.join(problems)}") from None


def _problem_text(problem: ErrorDetails, known: frozenset[str]) -> str:
    """Format a problem: its place, the error, and the given value."""
    place = ".".join(map(str, problem["loc"]))
    if problem["type"] == "extra_forbidden":
        near = difflib.get_close_matches(str(problem["loc"][-1]), known, n=1)
        return f"{place}: unknown key" + (f", did you mean {near[0]!r}?" if near else "")
    what = problem["msg"].removeprefix("Value error, ")
    given = problem["input"]
    if problem["loc"] and isinstance(given, (str, int, float)):
        what = f"{what}, not {given!r}"
    return f"{place}: {what}" if place else what


def _names(kind: type[Section]) -> frozenset[str]:
    """Return all keys of a section and the sections in it."""
    schema = kind.model_json_schema()
    sections = [schema, *schema.get("$defs", {}).values()]
    return frozenset(name for section in sections for name in section.get("properties", {}))
