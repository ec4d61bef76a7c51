"""Authentication of a vehicle's frames, and signing of ours to it."""

from __future__ import annotations

import logging
from collections import Counter

from fleet_mavlink.codec import PLAIN, Frame, FrameSettings
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.signing import Signer

_LOG = logging.getLogger(__name__)
UNSIGNED = "frames without a signature"
FALSE = "frames with a false or an old signature"


class FrameAuthentication:
    """Signature checks of one vehicle; ``counts`` counts refused and mismatching frames by reason."""

    def __init__(self, signer: Signer | None = None, *, accept_unsigned: bool = False) -> None:
        self.signer = signer
        self.signed = False  # whether the newest accepted frame was signed with our key
        self.frame_settings = FrameSettings(signer=signer) if signer is not None else PLAIN
        self.counts: Counter[str] = Counter()
        self._accept_unsigned = accept_unsigned

    def admits(self, frame: Frame) -> bool:
        """Return True when a frame is accepted; also learn the MAVLink version of its sender."""
        if self.signer is None:
            if isinstance(frame.message, Heartbeat) and frame.version != self.frame_settings.version:
                self.frame_settings = FrameSettings(version=frame.version)
            return True
        self.signed = bool(frame.signed) and self.signer.accepts(frame.signed)
        if self.signed:
            return True
        why = FALSE if frame.signed else UNSIGNED
        if not self.counts[why]:
            _LOG.warning("system %s sends %s", frame.system, why)
        self.counts[why] += 1
        return self._accept_unsigned and not frame.signed
