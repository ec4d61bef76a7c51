"""Reading a YAML file into a checked section; every problem names the file and the place."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import ValidationError

from fleet.errors import ConfigError
from fleet_quadruped.robot.parts import Section

SectionT = TypeVar("SectionT", bound=Section)


def read_tree(path: Path) -> Any:
    """Return what is in a YAML file; raises ConfigError."""
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        place = getattr(error, "problem_mark", None)
        where = f"{path}:{place.line + 1}" if place else str(path)
        raise ConfigError(f"{where}: {getattr(error, 'problem', None) or 'is not UTF-8 text'}") from None


def checked(path: Path, tree: Any, kind: type[SectionT]) -> SectionT:
    """Return a tree as a section; raises ConfigError with one line for each problem."""
    try:
        return kind.model_validate(tree)
    except ValidationError as error:
        lines = [f"{path}: {_place(problem['loc'])}{problem['msg']}" for problem in error.errors()]
        raise ConfigError("\n".join(lines)) from None


def _place(location: tuple[int | str, ...]) -> str:
    """Return where in the file a problem is, empty for the file as a whole."""
    return f"{'.'.join(map(str, location))}: " if location else ""
