"""The part of a fleet file that a stop needs: the edge's id and its bus settings.

Read without models and adapters, so that an error elsewhere, a missing secret or a hanging plugin cannot
prevent a stop.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

import msgspec

from fleet.bus.settings import BusSettings, BusTls
from fleet.config.yaml import Document, read_sections

_ID = re.compile(r"[a-z][a-z0-9_-]{0,62}")
_ID_IN_TEXT = re.compile(
    r"^\s*[\"{]*\s*edge\b[\"']?\s*:\s*\{?\s*[\"']?id[\"']?\s*:\s*[\"']?([a-z][a-z0-9_-]*)", re.MULTILINE
)


class EdgeOutline(msgspec.Struct, frozen=True):
    """Bus settings of a file's edge, as far as they are readable; ``problems`` lists the unreadable parts."""

    settings: BusSettings
    problems: tuple[str, ...] = ()


def outline(file: str, environ: Mapping[str, str] = os.environ) -> EdgeOutline:
    """Read a file; never raises for its content. An edge without a readable id has an empty one."""
    path = Path(file)
    document = read_sections(path, environ, ("edge", "bus"))
    data = document.data if isinstance(document.data, dict) else {}
    bus = _mapping(data, "bus")
    user, password = _text(bus, "user"), _text(bus, "password")
    problems = [problem.shown().splitlines()[0] for problem in document.problems]
    edge = _edge(data, document)
    if not edge:
        problems.append(f"{file}: it cannot be read which edge it is for")
    if (user is None) != (password is None):
        problems.append(f"{file}: bus.user and bus.password cannot both be read: tried without")
        user = password = None
    settings = BusSettings(
        edge=edge,
        connect=_texts(bus.get("connect")),
        tls=_tls(bus, path.parent),
        user=user,
        password=password,
    )
    return EdgeOutline(settings, tuple(problems))


def _edge(data: Mapping[str, object], document: Document) -> str:
    """Return the edge's id, by text search if the section is broken; empty if there is none."""
    found = _text(_mapping(data, "edge"), "id") or ""
    if not found:
        text = "\n".join(line for lines in document.lines.values() for line in lines)
        match = _ID_IN_TEXT.search(text)
        found = match[1] if match else ""
    return found if _ID.fullmatch(found) else ""


def _mapping(data: Mapping[str, object], name: str) -> Mapping[str, object]:
    """Return a section; empty if it is no mapping."""
    section = data.get(name)
    return section if isinstance(section, dict) else {}


def _text(section: Mapping[str, object], name: str) -> str | None:
    """Return a text of a section, None if there is none; numbers are converted."""
    value = section.get(name)
    return None if value is None or isinstance(value, dict | list) or value == "" else str(value)


def _texts(value: object) -> tuple[str, ...]:
    """Return a list of texts; other items are skipped."""
    return tuple(one for one in value if isinstance(one, str)) if isinstance(value, list) else ()


def _tls(bus: Mapping[str, object], folder: Path) -> BusTls:
    """Return the certificates, whose paths are relative to the fleet file."""
    tls = _mapping(bus, "tls")
    places = {name: str(folder / given) for name in ("root_ca", "cert", "key") if (given := _text(tls, name))}
    return BusTls(
        root_ca=places.get("root_ca"),
        certificate=places.get("cert"),
        key=places.get("key"),
        mutual=bool(tls) and tls.get("mutual") is not False,  # as fleet.yaml has it when it says nothing
        verify_name=tls.get("verify_name") is not False,
    )
