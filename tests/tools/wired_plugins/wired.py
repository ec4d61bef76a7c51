"""Wired adapter: a robot whose wire is a test's UDP socket; each velocity and each halt is one datagram."""

from __future__ import annotations

from typing import Literal

from fleet import AdapterConfig, FrameAdapter, Limits, PoseReport, Vector3, quaternion_from_yaw


class WiredConfig(AdapterConfig):
    """``link``: udpin:HOST:PORT, where the test sends."""

    adapter: Literal["wired"]
    link: str


class Wired(FrameAdapter[WiredConfig]):
    """Writes ``drive X``, X the velocity forward in m/s, and ``halt``; hears ``here``."""

    Config = WiredConfig
    limits = Limits(speed=1.0, yaw_rate=1.0)

    def drive(self, velocity):
        """Write a velocity."""
        return (f"drive {velocity.linear.x:g}".encode(),)

    def decode(self, frame, stamp):
        """Tell where it is, whatever was heard."""
        return (PoseReport(stamp, Vector3(), quaternion_from_yaw(0.0)),)

    def halt(self):
        """Write the halt."""
        return (b"halt",)
