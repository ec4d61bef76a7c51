"""Which frames of a vehicle are believed, how ours to it are made, and what was refused."""

from __future__ import annotations

import logging
from collections import Counter

from fleet_mavlink.codec import PLAIN, Frame, FrameSettings
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.signing import Signer

_LOG = logging.getLogger(__name__)
UNSIGNED = "frames without a signature"
FALSE = "frames with a false or an old signature"


class Trust:
    """The checks of one vehicle; ``counts`` says how often what was refused, or did not fit."""

    def __init__(self, signer: Signer | None = None, *, accept_unsigned: bool = False) -> None:
        self.signer = signer
        self.signed = False  # whether the newest frame that was believed was signed with our key
        self.way = FrameSettings(signer=signer) if signer is not None else PLAIN
        self.counts: Counter[str] = Counter()
        self._accept_unsigned = accept_unsigned

    def admits(self, frame: Frame) -> bool:
        """Return whether a frame may be believed; learn which version its sender speaks."""
        if self.signer is None:
            if isinstance(frame.message, Heartbeat) and frame.version != self.way.version:
                self.way = FrameSettings(version=frame.version)
            return True
        self.signed = bool(frame.signed) and self.signer.accepts(frame.signed)
        if self.signed:
            return True
        why = FALSE if frame.signed else UNSIGNED
        if not self.counts[why]:
            _LOG.warning("system %s sends %s", frame.system, why)
        self.counts[why] += 1
        return self._accept_unsigned and not frame.signed
