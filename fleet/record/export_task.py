"""What is to be exported: a window of recordings."""

from __future__ import annotations

import msgspec


class ExportTask(msgspec.Struct, frozen=True):
    """What was received from ``since`` until before ``until``, Unix s, by the recorders of these folders."""

    folders: tuple[str, ...]
    since: float
    until: float
