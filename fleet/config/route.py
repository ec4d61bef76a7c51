"""Routes for robots, from the command line or from a CSV or GeoJSON file.

CSV has one point per line: x,y[,z] in metres, or with a header line ``latitude,longitude[,altitude]`` on
Earth. GeoJSON (RFC 7946) has a LineString, or Points in order: longitude, latitude[, altitude].
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec

from fleet.errors import Refused

LARGEST = 1 << 20  # bytes of a file; a path with the maximum of waypoints is far smaller
METRES = ("x", "y", "z")
EARTH = ("latitude", "longitude", "altitude")


class Waypoints(msgspec.Struct, frozen=True):
    """Points in order, each of two or three numbers: metres, or with ``geo`` degrees and metres."""

    places: tuple[tuple[float, ...], ...]
    geo: bool = False


def is_name(word: str) -> bool:
    """Return True if a word of the command line is the name of a place, not a number."""
    return word[:1].isalpha() and "," not in word


def route_of(words: Sequence[str]) -> Waypoints:
    """Return the points of a command line: ``X Y [Z]``, or several ``X,Y[,Z]``; raises Refused."""
    if any("," in word for word in words):
        return Waypoints(tuple(_place(word.split(","), f"place {at}") for at, word in enumerate(words, 1)))
    return Waypoints((_place(words, "the place"),))


def read_route(file: Path) -> Waypoints:
    """Return the points of a CSV or GeoJSON file; raises Refused with the line or position in it."""
    try:
        with file.open("rb") as stream:
            data = stream.read(LARGEST + 1)
        text = data.decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise Refused(f"{file}: cannot be read: {error}") from None
    if len(data) > LARGEST:
        raise Refused(f"{file}: is larger than {LARGEST >> 20} MiB")
    try:
        return _of_geojson(text) if text.lstrip().startswith("{") else _of_csv(text)
    except Refused as error:
        raise Refused(f"{file}: {error.reason}", hint=error.hint) from None


def _of_csv(text: str) -> Waypoints:
    """Return the points of CSV."""
    try:
        rows = [(at, row) for at, row in enumerate(csv.reader(io.StringIO(text)), 1) if any(row)]
    except csv.Error as error:
        raise Refused(f"is no CSV: {error}") from None
    names = [cell.strip().lower() for cell in rows[0][1]] if rows else []
    heading = names and not _is_number(names[0])
    if heading and tuple(names) not in {METRES[:2], METRES, EARTH[:2], EARTH}:
        raise Refused(f"line {rows[0][0]}: the columns are x,y[,z] or latitude,longitude[,altitude]")
    places = tuple(_place(row, f"line {at}") for at, row in rows[1 if heading else 0 :])
    if not places:
        raise Refused("there is no place in it")
    return Waypoints(places, geo=bool(heading) and names[0] == EARTH[0])


def _of_geojson(text: str) -> Waypoints:
    """Return the points of GeoJSON, whose longitude comes first."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise Refused(f"is no JSON: {error}") from None
    found = list(_geometries(document))
    lines = [shape for shape in found if shape.get("type") == "LineString"]
    points = [shape for shape in found if shape.get("type") == "Point"]
    if len(lines) > 1 or bool(lines) == bool(points):
        raise Refused(
            f"{len(lines)} LineStrings and {len(points)} Points are in it",
            hint="a path is one LineString, or Points alone",
        )
    raw = lines[0].get("coordinates") if lines else [shape.get("coordinates") for shape in points]
    if not isinstance(raw, list) or not all(isinstance(each, list) and len(each) in {2, 3} for each in raw):
        raise Refused("its coordinates are not [longitude, latitude] or [longitude, latitude, altitude]")
    places = [_place([each[1], each[0], *each[2:]], f"place {at}") for at, each in enumerate(raw, 1)]
    if not places:
        raise Refused("there is no place in it")
    return Waypoints(tuple(places), geo=True)


def _geometries(document: object) -> Iterator[dict[str, object]]:
    """Yield the geometries of a GeoJSON object that are objects."""
    if not isinstance(document, dict):
        return
    if document.get("type") == "FeatureCollection":
        features = document.get("features")
        for feature in features if isinstance(features, list) else ():
            yield from _geometries(feature)
    elif document.get("type") == "Feature":
        yield from _geometries(document.get("geometry"))
    else:
        yield document


def _place(cells: Iterable[object], where: str) -> tuple[float, ...]:
    """Return one point; raises Refused."""
    numbers = [_number(cell, where) for cell in cells]
    if len(numbers) not in {2, 3}:
        raise Refused(f"{where}: two or three numbers are needed, these are {len(numbers)}")
    return tuple(numbers)


def _number(cell: object, where: str) -> float:
    """Return a finite number; raises Refused."""
    text = str(cell).strip()
    if not _is_number(text) or isinstance(cell, bool):
        raise Refused(f"{where}: {text[:40]!r} is no number")
    return float(text)


def _is_number(text: str) -> bool:
    """Return True if a text is a finite number."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
