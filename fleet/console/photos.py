"""The newest pictures of robots that pages show, only in JPEG; pure."""

from __future__ import annotations

from fleet.errors import WireError
from fleet.model.report import PhotoReport
from fleet.wire.databus import decode_report

MOST = 8  # robots with a stored picture; the one with the oldest picture is dropped
LARGEST = 8 << 20  # bytes of a picture
_JPEG = b"\xff\xd8\xff"


class Photos:
    """The newest picture of each robot, by its identity."""

    def __init__(self) -> None:
        self._newest: dict[str, PhotoReport] = {}

    def store(self, robot: str, sample: bytes) -> dict[str, object] | None:
        """Store a picture; return its description for pages, None for an invalid or older one."""
        if len(sample) > 2 * LARGEST:  # base64 in JSON
            return None
        try:
            report = decode_report(PhotoReport.channel, sample)
        except WireError:
            return None
        if not isinstance(report, PhotoReport) or not _is_picture(report.image):
            return None
        known = self._newest.pop(robot, None)
        kept = report if known is None or report.stamp >= known.stamp else known
        self._newest[robot] = kept
        while len(self._newest) > MOST:
            self._newest.pop(next(iter(self._newest)))
        return {"stamp": kept.stamp, "width": kept.width, "height": kept.height} if kept is report else None

    def newest(self, robot: str) -> bytes | None:
        """Return the newest picture of a robot, None if there is none."""
        report = self._newest.get(robot)
        return report.image if report is not None else None


def _is_picture(image: bytes) -> bool:
    """Return True for data that starts like a JPEG picture and is within the size limit."""
    return image.startswith(_JPEG) and len(image) <= LARGEST
