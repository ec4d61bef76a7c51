"""Plan and route files of missions, read together with the mission, so that a run has its own copy."""

from __future__ import annotations

import pathlib
from typing import Any

from fleet.config.problems import YamlPath
from fleet.config.route import LARGEST, read_route
from fleet.config.yaml import Document, read
from fleet.errors import Refused, WireError
from fleet.missions.plan import plan_in
from fleet.missions.points import MOST_POINTS, point_trouble

_YAML = frozenset({".yaml", ".yml"})


def with_files(data: Any, at: YamlPath, document: Document, folder: pathlib.Path) -> Any:
    """Return a mission's data with file names replaced by the contents of the files.

    Errors in a file are reported where it is named, or in the file itself if it is YAML.
    """
    if isinstance(data, dict):
        return {key: _member(key, value, (*at, key), document, folder) for key, value in data.items()}
    if isinstance(data, list):
        return [with_files(each, (*at, index), document, folder) for index, each in enumerate(data)]
    return data


def _member(key: str, value: Any, at: YamlPath, document: Document, folder: pathlib.Path) -> Any:
    """Return the value of a key; for a plan or a path, the contents of the named files."""
    if key == "plan" and isinstance(value, str | list):
        return _each(value, at, document, folder)
    if key == "path" and (isinstance(value, str) or _names_files(value)):
        return _each(value, at, document, folder)
    return with_files(value, at, document, folder)


def _names_files(value: Any) -> bool:
    """Return True if a list contains a file name."""
    return isinstance(value, list) and any(isinstance(each, str) for each in value)


def _each(value: Any, at: YamlPath, document: Document, folder: pathlib.Path) -> Any:
    """Return the content of a file, or of each file in a list; other values unchanged."""
    if isinstance(value, list):
        return [_each(each, (*at, index), document, folder) for index, each in enumerate(value)]
    if not isinstance(value, str):
        return value
    file = folder / value
    try:
        return plan_in(_bytes_of(file)) if "plan" in at[-2:] else _route_in(file, document)
    except (OSError, WireError, Refused) as error:
        why = str(error.strerror) if isinstance(error, OSError) else str(error)
        document.report(document.marks[at], f"{value}: {why.removeprefix(f'{file}: ')}")
        return None


def _route_in(file: pathlib.Path, document: Document) -> list[Any]:
    """Return the points of a route; raises Refused. Errors in a YAML file are reported in it."""
    if file.suffix in _YAML:
        return _yaml_route(file, document)
    route = read_route(file)
    if not route.geo:
        return [list(place) for place in route.places]
    return [dict(zip(("lat", "lon", "alt"), place, strict=False)) for place in route.places]


def _yaml_route(file: pathlib.Path, document: Document) -> list[Any]:
    """Return the list of points in a YAML file; raises OSError, and Refused for other content."""
    file.open("rb").close()
    found = read(file, {})
    document.problems += found.problems
    document.lines.update(found.lines)
    if found.problems:
        return []
    if not isinstance(found.data, list) or not 1 <= len(found.data) <= MOST_POINTS:
        raise Refused(f"is no list of 1 to {MOST_POINTS} points")
    for index, point in enumerate(found.data):
        trouble = point_trouble(point)
        if trouble:
            document.report(found.marks[(index,)], trouble)
    return found.data


def _bytes_of(path: pathlib.Path) -> bytes:
    """Read a file; raises OSError, and WireError if it is too large."""
    with path.open("rb") as file:
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise WireError(f"is larger than {LARGEST >> 20} MiB")
    return data
