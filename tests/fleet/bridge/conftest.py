from collections.abc import Callable
from functools import partial

import pytest

from fleet.model.command import Reply, Request, Transport
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import PoseReport
from fleet.testing.clock import ManualClock
from fleet.wire.databus import encode_report
from fleet.wire.topics import Topics

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
OTHER = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12"


class FakePort:
    """A robot that answers as the test says."""

    def __init__(
        self, name: str, twin: str, *, source_type: str = "edge", legacy_status: bool = True
    ) -> None:
        self.name = name
        self.twin = twin
        self.source_type = source_type
        self.legacy_status = legacy_status
        self.unread: list[str] = []
        self.emergencies: list[bytes] = []
        self.received: list[tuple[str, bytes, str]] = []
        self.answers: Callable[[str, bytes], Reply | None] = lambda _kind, _payload: None
        self.raises: Exception | None = None
        self.once = False

    def read(self, kind, payload, *, transport, request_id="", waits=False, unread=""):
        assert transport is Transport.CLOUD
        if self.raises is not None:
            raise self.raises
        if b"emergency_stop" in payload or unread:
            self.emergencies.append(payload)
        self.unread.append(unread)
        stops = bool(unread) or b'"stop"' in payload or b'"emergency_stop"' in payload
        return Request(partial(self.handle, (kind, payload, request_id)), stops, self.once)

    def handle(self, what, answer):
        self.received.append(what)
        reply = self.answers(*what[:2])
        if reply is not None:
            answer(reply)


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def topics():
    return Topics("")


@pytest.fixture
def rex():
    return FakePort("rex", TWIN)


@pytest.fixture
def ports(rex):
    kestrel = FakePort("kestrel", OTHER, source_type="sim", legacy_status=False)
    return {port.twin: port for port in (rex, kestrel)}


@pytest.fixture
def pose():
    """Make a sample of the position channel."""

    def pose(x: float) -> bytes:
        return encode_report(PoseReport(1.0, Vector3(x, 2.0, 3.0), Quaternion()), 0)

    return pose
