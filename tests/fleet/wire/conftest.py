"""Hostile bytes, every kind of report and one twin, for the tests of the wire."""

import random
from collections.abc import Callable, Iterable, Iterator

import pytest
from hypothesis import strategies as st

from fleet.model.command import Transport
from fleet.model.event import EventKind, EventReport, Requester, Severity
from fleet.model.geodesy import GeoPoint
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.navigation import ActionState
from fleet.model.report import (
    BatteryReport,
    DepthReport,
    FlightControllerReport,
    FlightStateReport,
    GpsReport,
    ImuReport,
    JointReport,
    JointTags,
    LogReport,
    MetricsReport,
    MissionProgress,
    NavigationReport,
    PhotoReport,
    PointCloudReport,
    PoseReport,
    ScaleReport,
    StatusText,
    TelemetryReport,
)

TWIN = "6f0c9a1e-3b7d-4c55-9a41-0d6f6f1f2a10"


@pytest.fixture
def twin() -> str:
    return TWIN


def _mutated(source: bytes, rng: random.Random) -> bytes:
    """Return ``source`` with a few bytes changed, lost, doubled or swapped for a dangerous word."""
    words = [b"NaN", b"1e999", b'"5"', b"true", b"null", b"[", b"{}", b"-Infinity", b"\\ud800", b"\xff"]
    data = bytearray(source)
    for _ in range(rng.randint(1, 6)):
        at = rng.randrange(len(data) + 1)
        until = min(len(data), at + rng.randint(0, 8))
        data[at:until] = rng.choice([b"", rng.randbytes(3), rng.choice(words), data[at:until] * 2])
    return bytes(data)


@pytest.fixture
def hostile() -> Callable[[Iterable[bytes]], Iterator[bytes]]:
    """Return a maker of 12 000 byte strings near the given ones; the same ones in every run."""

    def make(sources: Iterable[bytes]) -> Iterator[bytes]:
        rng = random.Random(20)
        pool = list(sources)
        for _ in range(12_000):
            yield _mutated(rng.choice(pool), rng)

    return make


FINITE = st.floats(allow_nan=False, allow_infinity=False)
STAMPS = st.floats(0, 4e9)
WORDS = st.text(max_size=12)
VECTORS = st.builds(Vector3, FINITE, FINITE, FINITE)
PLACES = st.builds(GeoPoint, st.floats(-90, 90), st.floats(-180, 180), FINITE)
JOINTS = st.dictionaries(WORDS, FINITE, max_size=4)
PLAIN = st.dictionaries(
    WORDS, st.none() | st.booleans() | FINITE | WORDS | st.lists(FINITE, max_size=2), max_size=3
)
COUNTS = st.integers(0, 2**31)


TAGS = st.builds(
    JointTags,
    WORDS,
    st.none() | WORDS,
    st.none() | st.lists(st.fixed_dictionaries({"track_id": WORDS, "frame_count": COUNTS}), max_size=2),
)


@st.composite
def _joint_reports(draw):
    positions = draw(JOINTS)
    some = st.dictionaries(st.sampled_from(sorted(positions)), FINITE) if positions else st.just({})
    return JointReport(draw(STAMPS), positions, draw(some), draw(some), draw(st.none() | TAGS))


SENSORS = st.sampled_from(["", "front", "lidar_2"])
POSITIVE = st.floats(1e-6, 1e6)


@st.composite
def _depth_reports(draw):
    width, height, dtype = (
        draw(st.integers(1, 4)),
        draw(st.integers(1, 4)),
        draw(st.sampled_from(["uint16", "float32"])),
    )
    size = width * height * (2 if dtype == "uint16" else 4)
    image = draw(st.binary(min_size=size, max_size=size))
    return DepthReport(draw(STAMPS), image, width, height, dtype, draw(SENSORS))


@st.composite
def _pointcloud_reports(draw):
    stride = draw(st.sampled_from([3, 6]))
    size = draw(st.integers(1, 4)) * stride * 4
    return PointCloudReport(
        draw(STAMPS), draw(st.binary(min_size=size, max_size=size)), stride, draw(SENSORS)
    )


REPORTS = {
    ScaleReport: st.builds(ScaleReport, STAMPS, st.builds(Vector3, POSITIVE, POSITIVE, POSITIVE)),
    DepthReport: _depth_reports(),
    PointCloudReport: _pointcloud_reports(),
    PoseReport: st.builds(
        PoseReport, STAMPS, VECTORS, st.builds(Quaternion, FINITE, FINITE, FINITE, FINITE), WORDS
    ),
    JointReport: _joint_reports(),
    BatteryReport: st.builds(
        BatteryReport,
        STAMPS,
        st.none() | st.floats(0, 100),
        st.none() | st.floats(0, 100),
        st.none() | FINITE,
    ),
    GpsReport: st.builds(
        GpsReport,
        STAMPS,
        PLACES,
        st.sampled_from(["none", "2d", "3d", "rtk_fixed"]),
        st.none() | COUNTS,
        st.none() | FINITE,
        st.none() | FINITE,
        st.none() | FINITE,
    ),
    ImuReport: st.builds(ImuReport, STAMPS, VECTORS, VECTORS),
    FlightStateReport: st.builds(FlightStateReport, STAMPS, st.booleans(), WORDS),
    FlightControllerReport: st.builds(
        FlightControllerReport,
        STAMPS,
        st.booleans(),
        WORDS,
        st.booleans(),
        WORDS,
        WORDS,
        st.none() | COUNTS,
        st.none() | COUNTS,
        st.none() | st.booleans(),
        st.lists(st.builds(StatusText, WORDS, st.integers(0, 7)), max_size=3).map(tuple),
        st.booleans(),
        st.none() | st.integers(1, 255),
        COUNTS,
        st.none() | st.builds(MissionProgress, COUNTS, st.none() | COUNTS, st.none() | COUNTS),
        st.none() | PLACES,
    ),
    MetricsReport: st.builds(
        MetricsReport,
        STAMPS,
        PLAIN,
        PLAIN,
        st.none() | st.lists(PLAIN, max_size=2).map(tuple),
        st.dictionaries(st.sampled_from(["load", "fan"]), PLAIN | FINITE, max_size=2),
    ),
    NavigationReport: st.builds(
        NavigationReport, STAMPS, WORDS, st.sampled_from(ActionState), st.floats(0, 100), WORDS
    ),
    TelemetryReport: st.builds(TelemetryReport, STAMPS, WORDS, PLAIN),
    PhotoReport: st.builds(PhotoReport, STAMPS, st.binary(max_size=40), WORDS, COUNTS, COUNTS),
    EventReport: st.builds(
        EventReport,
        STAMPS,
        st.sampled_from(EventKind),
        WORDS,
        st.sampled_from(Severity),
        st.none() | st.builds(Requester, st.sampled_from(Transport), WORDS, st.none() | WORDS, st.booleans()),
        WORDS,
        WORDS,
        PLAIN,
    ),
    LogReport: st.builds(
        LogReport,
        STAMPS,
        st.sampled_from(["DEBUG", "INFO", "ERROR"]),
        WORDS,
        st.dictionaries(st.sampled_from(["container_name", "sdk_version"]), WORDS),
    ),
}


@pytest.fixture(scope="session")
def reports() -> dict[type, st.SearchStrategy]:
    """Return a strategy for every kind of report, within the ranges that their contracts allow."""
    return REPORTS
