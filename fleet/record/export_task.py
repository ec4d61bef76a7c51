"""Task of an export: a window of recordings."""

from __future__ import annotations

import msgspec


class ExportTask(msgspec.Struct, frozen=True):
    """The messages received from ``since`` until before ``until``, Unix s, in these folders."""

    folders: tuple[str, ...]
    since: float
    until: float
