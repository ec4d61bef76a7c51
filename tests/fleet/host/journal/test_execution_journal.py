"""The log in memory: what is written survives the process, whole rows only, and each file has one owner."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.host.journal.execution_journal import ANY, FORMAT, SIZE, ExecutionJournal, Latched, StartedCommand

BEGUN = "begun.main"
ROWS = st.one_of(
    st.builds(Latched, st.sampled_from(["rex", "max"]), st.text(max_size=40)),
    st.builds(
        StartedCommand, st.just("rex"), st.text(max_size=9), st.just("land"), st.booleans(), st.just(2e9)
    ),
)
STEPS = st.lists(
    st.one_of(
        ROWS.map(lambda row: ("add", row)),
        st.lists(ROWS, max_size=3).map(lambda rows: ("replace", rows)),
        st.just(("clear", None)),
        st.just(("open", None)),
    ),
    max_size=12,
)


def rows_of(path):
    """Return the rows that another process reads in a file."""
    other = ExecutionJournal(path.with_name("begun.reader"))
    with other.all_rows() as rows:
        pass
    other.close()
    return rows


@pytest.mark.parametrize(
    "left",
    [
        b'\0"latch","rex","panel"]\n["latch","rex",""]\n',  # a clear that was cut after its first byte
        b"\0" * 30 + b'["latch","rex",""]\n',  # or later
        b'["latch","rex","panel"]\n["latch","rex","pa',  # a row that was cut
        b'["latch","rex","panel"]\n["latch"\0\0\0"pa',
    ],
)
def test_what_death_left_in_a_file_does_not_follow_on_what_is_written_next(tmp_path, left, monkeypatch):
    path = tmp_path / "begun.main"
    path.write_bytes(left)
    begun = ExecutionJournal(path)
    begun.add(Latched("rex", "fire"))
    begun.close()
    again = ExecutionJournal(path)
    with again.all_rows() as rows:
        assert rows[-1] == Latched("rex", "fire")
        assert rows[:-1] in ([], [Latched("rex", "panel")])
    again.close()


def test_a_file_that_another_process_still_has_is_left_to_it(tmp_path):
    path = tmp_path / "begun.arm"
    dying, risen, edge = (
        ExecutionJournal(path),
        ExecutionJournal(path),
        ExecutionJournal(tmp_path / "begun.main"),
    )
    dying.add(Latched("rex", "fire"))
    risen.add(Latched("max", "smoke"))
    dying.close()
    with edge.all_rows() as rows:
        assert set(rows) == {Latched("rex", "fire"), Latched("max", "smoke")}
    with edge.all_rows() as rows:  # the dead one's are forgotten, who lives keeps its own
        assert rows == [Latched("max", "smoke")]
    risen.add(Latched("eve", "fire"))
    risen.clear()
    for each in (risen, edge):
        each.close()


def test_a_file_grows_by_nothing_but_what_it_holds_and_is_small_again_after_a_start(tmp_path):
    path = tmp_path / "begun.main"
    begun = ExecutionJournal(path)
    begun.add(Latched("rex", "x" * 500_000))
    begun.close()
    assert path.stat().st_size > 500_000
    for _ in range(3):
        begun = ExecutionJournal(path)
        with begun.all_rows():
            pass
        begun.add(Latched("rex", "fire"))
        begun.close()
        assert path.stat().st_size == SIZE


def test_rows_are_replaced_all_or_none(tmp_path, monkeypatch):
    path = tmp_path / BEGUN
    begun = ExecutionJournal(path)
    begun.add(Latched("rex", "fire"))
    with monkeypatch.context() as patch:
        patch.setattr("os.pwrite", lambda _file, data, _at: len(data) - 1)
        with pytest.raises(OSError, match="No space left"):
            begun.replace([Latched("max", "fire")])
    begun.add(StartedCommand("rex", "r1", "land", False, 1.0))
    assert path.read_bytes().count(b"fire") == 1
    begun.replace([Latched("max", "fire")])
    begun.add(Latched("eve", "fire"))
    begun.close()
    again = ExecutionJournal(path)
    with again.all_rows() as rows:
        assert rows == [Latched("max", "fire"), Latched("eve", "fire")]
    again.close()


def test_a_file_with_replaced_rows_is_still_that_of_a_living_process(tmp_path):
    path = tmp_path / BEGUN
    begun, other = ExecutionJournal(path), ExecutionJournal(tmp_path / "begun.arm")
    begun.replace([Latched("rex", "fire")])
    for _ in range(2):
        with other.all_rows() as rows:
            assert rows == [Latched("rex", "fire")]
    for each in (begun, other):
        each.close()


def test_a_release_that_death_left_right_behind_a_later_stop_is_forgotten(tmp_path):
    path = tmp_path / BEGUN
    begun = ExecutionJournal(path)
    begun.add(Latched("rex", "fire"))
    length = begun.length
    begun.close()
    path.write_bytes(b"\0" * length + b'["latch","rex",""]\n')
    begun = ExecutionJournal(path)
    begun.add(Latched("rex", "fire"))
    assert rows_of(path) == [Latched("rex", "fire")]
    begun.close()


@pytest.mark.parametrize("write", [ExecutionJournal.add, lambda begun, row: begun.replace([row])])
def test_a_file_begins_with_its_format(tmp_path, write):
    begun = ExecutionJournal(tmp_path / BEGUN)
    write(begun, Latched("rex", "fire"))
    assert (tmp_path / BEGUN).read_bytes().startswith(b'["format",%d]\n["latch"' % FORMAT)
    begun.close()


@given(STEPS)
def test_a_file_has_exactly_what_was_written_since_it_was_emptied(tmp_path_factory, steps):
    path = tmp_path_factory.mktemp("memory") / BEGUN
    begun, expected = ExecutionJournal(path), []
    for step, value in steps:
        if step == "add":
            begun.add(value)
            expected.append(value)
        elif step == "replace":
            begun.replace(value)
            expected = list(value)
        elif step == "clear":
            begun.clear()
            expected = []
        else:  # the process ends, and another one follows it
            begun.close()
            begun = ExecutionJournal(path)
        assert rows_of(path) == expected
    assert path.read_bytes().index(b"\0") == begun.length
    begun.close()


def test_rows_are_there_without_an_orderly_end(tmp_path):
    begun = ExecutionJournal(tmp_path / BEGUN)
    begun.add(Latched("rex", "fire"))
    assert rows_of(tmp_path / BEGUN) == [Latched("rex", "fire")]
    begun.close()


def test_the_rows_of_the_dead_stay_if_their_reader_fails(tmp_path):
    path = tmp_path / BEGUN
    begun = ExecutionJournal(path)
    begun.add(Latched("rex", "fire"))
    begun.close()
    reader = ExecutionJournal(path.with_name("begun.reader"))
    with pytest.raises(OSError, match="disk"), reader.all_rows():
        raise OSError("the disk took nothing")
    reader.close()
    assert rows_of(path) == [Latched("rex", "fire")]
    assert rows_of(path) == []


def test_a_file_of_a_newer_format_stops_every_robot(tmp_path, caplog):
    path = tmp_path / BEGUN
    path.write_bytes(b'["format",%d]\n["latch","rex",""]\n["set","max"]\n' % (FORMAT + 1))
    (stop,) = rows_of(path)
    assert stop.robot == ANY
    assert "whether a stop was set is unknown" in stop.why
    assert "every robot is stopped" in caplog.text


def test_a_file_without_a_format_is_read(tmp_path):
    path = tmp_path / BEGUN
    path.write_bytes(b'["latch","rex","fire"]\nnot a row\n["latch","max","smoke"]\n')
    assert rows_of(path) == [Latched("rex", "fire"), Latched("max", "smoke")]
