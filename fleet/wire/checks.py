"""Type checks of reports before they are encoded: msgspec structs are not checked when constructed."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import get_args

import msgspec

from fleet.errors import WireError
from fleet.model.report import Report
from fleet.runtime.decoding import msgpack_decoder
from fleet.wire.encoding import UNSAYABLE

_PACK = msgspec.msgpack.Encoder().encode
_CHECKS: Mapping[type[object], msgspec.msgpack.Decoder[object]] = MappingProxyType(
    {kind: msgpack_decoder(kind) for kind in get_args(Report)}
)


def check_report(report: Report) -> None:
    """Raise WireError for a report with a field of the wrong type."""
    try:
        _CHECKS[type(report)].decode(_PACK(report))  # the fastest check that covers every kind of report
    except UNSAYABLE as error:
        raise WireError(str(error), where=report.channel) from None
