"""Series of recorded numbers: thinned without losing a peak, and bounded."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.console.past import RecordingReader
from fleet.console.requests import PageSeriesRequest
from fleet.console.series import MOST_SPENT, MOST_WINDOW, Downsampled, read_series, require_bounds
from fleet.errors import Refused
from fleet.record.messages import Message
from fleet.record.recorded_folder import RecordedFolder
from fleet.record.ring import Ring
from fleet.record.task import Bounds
from fleet.record.window import Window
from tests.tools.recordings import write_recording

BEGINS = 1_795_000_000.0
SECONDS = 30
VALUES = st.lists(st.tuples(st.floats(0.0, 100.0), st.floats(-1e6, 1e6)), max_size=200)


def thinned(values, most, *, since=0.0, until=100.0):
    found = Downsampled(since, until, most)
    for at, value in values:
        found.add(at, value)
    return found.points()


@given(VALUES, st.integers(2, 60))
def test_the_points_are_values_in_order_and_not_too_many(values, most):
    points = thinned(values, most)
    assert set(points) <= set(values)
    assert points == sorted(points)
    assert len(points) <= most


@given(VALUES.filter(bool), st.integers(2, 60))
def test_the_least_and_the_greatest_value_stay(values, most):
    kept = [value for _, value in thinned(values, most)]
    assert (min(kept), max(kept)) == (min(v for _, v in values), max(v for _, v in values))


@given(VALUES, st.integers(2, 60), st.randoms())
def test_the_points_do_not_depend_on_the_order_of_the_values(values, most, random):
    mixed = random.sample(values, len(values))
    assert thinned(values, most) == thinned(mixed, most)


@given(VALUES, st.integers(2, 60))
def test_no_stretch_with_values_is_left_without_points(values, most):
    length = 100.0 / (most // 2)
    points = [at for at, _ in thinned(values, most)]
    assert all(any(abs(at - each) <= length * 1.001 for each in points) for at, _ in values)


def test_a_peak_of_one_value_among_thousands_stays():
    flat = [(second / 100, 0.0) for second in range(10_000)]
    assert (37.77, 9.0) in thinned([*flat, (37.77, 9.0)], 10)


@pytest.mark.parametrize(
    ("robot", "since", "until", "why"),
    [
        ("rex", 1.0, 2.0, "its name is EDGE/ROBOT"),
        ("yard/rex/state", 1.0, 2.0, "its name is EDGE/ROBOT"),
        ("/rex", 1.0, 2.0, "its name is EDGE/ROBOT"),
        ("yard/rex", 2.0, 2.0, "begins before it ends"),
        ("yard/rex", -1.0, 2.0, "begins before it ends"),
        ("yard/rex", 1.0, 1e300, "begins before it ends"),
        ("yard/rex", 1.0, float("nan"), "begins before it ends"),
        ("yard/rex", 1.0, 1.0 + MOST_WINDOW + 1, "10 min at most"),
    ],
)
def test_a_robot_or_window_that_cannot_be_is_refused(robot, since, until, why):
    with pytest.raises(Refused, match=why):
        require_bounds(PageSeriesRequest("r", robot, since, until))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return the folder of a recording."""
    made = tmp_path_factory.mktemp("series") / "recordings"
    write_recording(made, BEGINS, SECONDS)
    return made


def read(folder, *names, since=0.0, until=SECONDS, points=1000, spent=lambda: 0.0, robot="yard-1/rex"):
    requested = PageSeriesRequest("r", robot, BEGINS + since, BEGINS + until, names, points)
    window = Window(f"/{robot}/", requested.since, requested.until)
    RecordedFolder(folder).find(window)
    return read_series(requested, window, spent)


def test_the_values_of_the_window_are_reported_at_their_times(folder):
    found = read(folder, "position.x", "joint_states.positions.knee", since=2.0, until=4.0)
    times, values = found["values"]["position.x"]
    assert [at - BEGINS for at in times] == values == [2.0, 2.5, 3.0, 3.5, 4.0]
    assert found["values"]["joint_states.positions.knee"][1] == [0.2, 0.25, 0.3, 0.35, 0.4]
    assert (found["share"], found["problems"]) == (1.0, [])


def test_all_recorded_numbers_are_offered_and_only_the_wanted_ones_sent(folder):
    found = read(folder)
    assert {"position.x", "position.qw", "joint_states.positions.knee"} <= set(found["names"])
    assert not [name for name in found["names"] if name.startswith(("transform", "history", "description"))]
    assert found["values"] == {}


def test_a_number_that_was_not_recorded_has_no_values_and_an_empty_window_no_numbers(folder):
    assert read(folder, "battery.charge_pct")["values"] == {"battery.charge_pct": [[], []]}
    found = read(folder, "position.x", since=100.0, until=160.0)
    assert (found["names"], found["values"]) == ([], {"position.x": [[], []]})
    assert (found["share"], found["problems"]) == (1.0, [])
    assert read(folder, "position.x", robot="yard-1/nobody")["names"] == []


def test_when_the_time_is_used_up_the_read_share_is_spread_over_the_window(folder):
    clock = itertools.count(0.0, MOST_SPENT / 10)
    found = read(folder, "position.x", spent=lambda: next(clock))
    times = [at - BEGINS for at in found["values"]["position.x"][0]]
    assert 5 <= len(times) <= 12
    assert (times[0] < 5, times[-1] > 20) == (True, True)
    assert found["share"] == pytest.approx(len(times) / (2 * SECONDS), abs=0.02)


def test_the_points_of_a_number_are_limited(folder):
    times, _ = read(folder, "position.x", points=8)["values"]["position.x"]
    assert len(times) <= 8


def test_messages_that_cannot_be_read_are_reported(tmp_path):
    ring = Ring(tmp_path, Bounds(free=0))
    file = ring.file(BEGINS)
    file.add(Message("/yard-1/rex/battery", "fleet.BatteryReport", b'{"stamp": "x"}'), round(BEGINS * 1e9))
    ring.close()
    found = read(tmp_path, "battery.charge_pct")
    assert found["problems"] == ["unreadable messages of /yard-1/rex/battery: 1"]


async def test_a_file_that_is_cut_off_is_reported_with_the_series(tmp_path):
    write_recording(tmp_path, BEGINS, 10)
    (path,) = tmp_path.glob("*.mcap")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 4])
    recordings = RecordingReader(lambda: [tmp_path])
    found = await recordings.series(
        PageSeriesRequest("r", "yard-1/rex", BEGINS, BEGINS + 10, ("position.x",))
    )
    assert found["values"]["position.x"][1][0] == 0.0
    assert path.name in found["problems"][0]
    with pytest.raises(Refused, match="begins before it ends"):
        await recordings.series(PageSeriesRequest("r", "yard-1/rex", BEGINS, BEGINS))
