"""The file of a spool: what is written is read again, and it stays within its size."""

import contextlib
import sqlite3

import pytest

from fleet.spool.losses import Gap, Reason
from fleet.spool.message import Outgoing
from fleet.spool.store import FULL_AT, LEAST_EVICTED, ROOM_AT, SpoolFile, StoredTopic
from fleet.wire.rules import TrafficClass

REPLY, STATUS, EVENT = TrafficClass.REPLY, TrafficClass.STATUS, TrafficClass.EVENT
MIB = 1024 * 1024


@pytest.fixture
def reopened(tmp_path):
    """Open the file in a new process; the process before has closed it."""
    opened = []

    def reopened(size=MIB):
        while opened:
            opened.pop().close()
        opened.append(SpoolFile(tmp_path / "spool.db", size))
        return opened[-1]

    yield reopened
    for each in opened:
        each.close()


@pytest.fixture
def store(reopened):
    return reopened()


def message(seq, topic="t", traffic=EVENT, payload=b"", **more):
    return Outgoing(topic, payload, 1, traffic, seq=seq, **{"expires": 100.0, **more})


def seqs(messages):
    return [each.seq for each in messages]


def left(store, topic="t"):
    return seqs(store.fetch(topic, 0, 10_000, EVENT))


def test_a_message_is_read_as_it_was_written(reopened):
    written = message(7, payload=b"\x00\xff", expires=12.5, correlation=b"c", content_type="application/json")
    reopened().change([written, message(8)], [])
    found, bare = reopened().fetch("t", 0, 10, EVENT)
    assert (found.topic, found.payload, found.qos, found.traffic, found.seq) == (
        "t",
        b"\x00\xff",
        1,
        EVENT,
        7,
    )
    assert (found.expires, found.correlation, found.content_type) == (12.5, b"c", "application/json")
    assert (found.stored, found.on_disk, found.gone, found.again) == (True, False, False, False)
    assert (bare.payload, bare.correlation, bare.content_type) == (b"", None, None)


def test_a_fetch_returns_the_oldest_of_a_topic_behind_a_number(store):
    store.change([message(seq) for seq in (4, 2, 3, 1)] + [message(5, "other")], [])
    assert seqs(store.fetch("t", 0, 10, EVENT)) == [1, 2, 3, 4]
    assert seqs(store.fetch("t", 1, 2, EVENT)) == [2, 3]
    assert seqs(store.fetch("t", 4, 10, EVENT)) == []
    assert seqs(store.fetch("unknown", 0, 10, EVENT)) == []


def test_written_and_deleted_messages_change_at_once(store):
    store.change([message(1), message(2)], [])
    store.change([message(3)], [1, 3, 99])
    assert left(store) == [2]


def test_a_change_that_fails_changes_nothing_and_the_next_one_works(store):
    store.change([message(1)], [], [Gap("t", Reason.AGE, 1, 1.0, 2.0)])
    with pytest.raises(sqlite3.IntegrityError):
        store.change([message(2, "new"), message(1)], [1], [])
    assert (left(store), left(store, "new"), len(store.losses())) == ([1], [], 1)
    store.change([message(2, "new")], [])
    assert {each.topic: each.count for each in store.left()} == {"t": 1, "new": 1}


def test_the_topics_left_are_told_with_their_class_count_and_numbers(reopened):
    reopened().change([message(5), message(2), message(9, "s", STATUS), message(3)], [])
    found = {each.topic: each for each in reopened().left()}
    assert found == {"t": StoredTopic("t", EVENT, 3, 2, 5), "s": StoredTopic("s", STATUS, 1, 9, 9)}


def test_a_topic_without_messages_is_not_told_and_not_kept(reopened):
    store = reopened()
    store.change([message(1), message(2, "s", STATUS)], [])
    store.change([], [1])
    assert [each.topic for each in store.left()] == ["s"]
    assert list(reopened()._known_ids()) == ["s"]


def test_losses_are_replaced_as_a_whole_or_left_as_they_are(reopened):
    gaps = [Gap("t", Reason.AGE, 3, 1.0, 2.0), Gap("t", Reason.ROOM, 1, 4.5, 4.5)]
    store = reopened()
    store.change([], [], gaps)
    store.change([message(1)], [])
    assert reopened().losses() == gaps
    store = reopened()
    store.change([], [], gaps[1:])
    assert store.losses() == gaps[1:]
    store.change([], [], [])
    assert store.losses() == []


def test_expired_messages_are_removed_from_their_time_on(store):
    store.change([message(1, expires=10.0), message(2, "u", expires=10.5), message(3, expires=11.0)], [])
    assert store.expire(9.9) == []
    assert sorted(store.expire(10.5)) == [("t", 1), ("u", 2)]
    assert left(store) == [3]


def test_a_part_of_very_many_expired_messages_is_removed_at_once(store):
    store.change([message(seq) for seq in range(5 * LEAST_EVICTED + 10)], [])
    assert [len(store.expire(100.0)) for _ in range(3)] == [5 * LEAST_EVICTED, 10, 0]


def test_only_messages_of_this_process_are_postponed(store):
    store.change([message(seq, expires=10.0) for seq in (1, 2, 3)], [])
    store.postpone(-2.5, after=1)
    assert [each.expires for each in store.fetch("t", 0, 10, EVENT)] == [10.0, 7.5, 7.5]


def test_the_bytes_in_use_grow_with_the_messages_and_fall_when_they_are_deleted(store):
    before = store.used
    assert before % 4096 == 0
    store.change([message(seq, payload=bytes(4096)) for seq in range(20)], [])
    assert before + 20 * 4096 <= store.used <= before + 45 * 4096
    store.change([], range(20))
    assert store.used == before


def test_there_is_room_up_to_nine_tenths_of_the_budget(store):
    spare = FULL_AT * MIB - store.used
    assert store.room(int(spare) - 1)
    assert not store.room(int(spare) + 1)


def test_the_file_never_grows_beyond_its_size(reopened):
    store = reopened(64 * 4096)
    with pytest.raises(sqlite3.OperationalError, match="full"):
        store.change([message(seq, payload=bytes(4096)) for seq in range(100)], [])
    assert left(store) == []


def test_the_oldest_of_the_least_important_class_give_way_and_no_more_than_needed(store):
    store.change([message(seq, "s", STATUS, bytes(1000)) for seq in range(1, 200)], [])
    store.change([message(seq, f"e{seq % 2}", EVENT, bytes(1000)) for seq in range(200, 800)], [])
    parts = list(store.evict(int(ROOM_AT * MIB - store.used) + 4096))
    assert [seq for part in parts for _, seq in part] == list(range(200, 200 + LEAST_EVICTED))
    assert {topic for topic, _ in parts[0]} == {"e0", "e1"}
    assert left(store, "s") == list(range(1, 200))
    assert list(store.evict(0)) == []


def test_more_important_messages_give_way_when_no_others_are_left(store):
    store.change([message(1, "r", REPLY), message(2, "s", STATUS), message(3, "e", EVENT)], [])
    assert list(store.evict(2 * MIB)) == [[("e", 3)], [("s", 2)], [("r", 1)]]


def test_a_file_that_was_set_aside_is_told(tmp_path, reopened):
    assert reopened().aside is None
    reopened().close()
    (tmp_path / "spool.db").write_bytes(b"rubbish" * 1000)
    store = reopened()
    assert store.aside == tmp_path / "spool.db.broken"
    assert store.left() == []


def test_a_checkpoint_brings_all_changes_into_the_file_itself(tmp_path, store):
    store.change([message(1, payload=b"precious")], [])
    assert b"precious" not in (tmp_path / "spool.db").read_bytes()
    store.checkpoint()
    assert b"precious" in (tmp_path / "spool.db").read_bytes()


def test_making_room_does_not_read_all_that_waits(tmp_path):
    steps = {}
    for count in (1000, 8000):
        store = SpoolFile(tmp_path / str(count), 64 * 1024 * 1024)
        rows = [
            Outgoing(f"t/{n % 5}", b"", 1, TrafficClass.STATUS, expires=1e12, seq=n)
            for n in range(1, count + 1)
        ]
        store.change(rows, [])
        seen = steps[count] = []
        store._database.set_progress_handler(lambda seen=seen: seen.append(1), 100)
        assert [seq for seq, _ in store._oldest()] == list(range(1, LEAST_EVICTED + 1))
        store.close()
    assert len(steps[8000]) < 2 * len(steps[1000])


def test_room_is_made_in_parts_however_large_the_file_is(tmp_path):
    store = SpoolFile(tmp_path / "spool", 4 * 1024 * 1024)
    seqs = range(1, 4001)
    with contextlib.closing(store):
        for start in range(0, 4000, 100):
            rows = [
                Outgoing("t", bytes(800), 1, TrafficClass.EVENT, expires=9e9, seq=seq)
                for seq in seqs[start : start + 100]
            ]
            store.change(rows, [])
        parts = list(store.evict(300_000))
        assert store.room(300_000)
    assert len(parts) > 1
    assert max(map(len, parts)) <= LEAST_EVICTED
    assert [seq for part in parts for _, seq in part] == list(seqs[: sum(map(len, parts))])
