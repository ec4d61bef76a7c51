"""The files of the page, read once into a table, so that no request path can reach any other file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import resources
from importlib.resources.abc import Traversable

import msgspec

TYPES: Mapping[str, str] = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


class PageFile(msgspec.Struct, frozen=True):
    """One file: its bytes and its media type."""

    content: bytes
    media_type: str


def page_files() -> dict[str, PageFile]:
    """Return the files by their URL path; ``/`` is the page itself."""
    static = resources.files("fleet.console").joinpath("static")
    found = dict(_in_folder(static, "/")) | dict(_in_folder(static.joinpath("vendor"), "/vendor/"))
    found["/"] = found.pop("/index.html")
    return found


def _in_folder(folder: Traversable, address: str) -> Iterator[tuple[str, PageFile]]:
    """Yield the public files of a folder, by their URL path."""
    for each in folder.iterdir():
        kind = TYPES.get(each.name[each.name.rfind(".") :])
        if kind is not None:
            yield f"{address}{each.name}", PageFile(each.read_bytes(), kind)
