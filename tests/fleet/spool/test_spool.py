"""The spool on a real disk: violent deaths, damaged files, two edges; and what is told."""

import os
import signal
import sqlite3
import subprocess
import sys

import pytest

from fleet.clock import SystemClock
from fleet.errors import StateError
from fleet.spool.disk import EXPIRE_EVERY
from fleet.spool.losses import Reason
from fleet.spool.spool import AGES
from fleet.spool.state_folder import SPOOL
from fleet.spool.unwritten import MOST_ROWS
from fleet.wire.rules import TrafficClass
from tests.tools.waiting import wait_until

KILLED = """
import os, signal, sys
from pathlib import Path
from fleet.clock import SystemClock
from fleet.spool.message import Outgoing
from fleet.spool.spool import Spool, SpoolSettings

spool = Spool(SpoolSettings(folder=Path(sys.argv[1])), SystemClock())
told = 0
for number in range(1_000_000):
    spool.put(Outgoing(f"t/{number % 3}", b"%d" % number, 1))
    if number % 500 == 499:
        while spool._queue.disk.unwritten:
            pass
        print(number, flush=True)
"""


def payloads(count):
    return [b"%d" % number for number in range(count)]


def test_what_waits_outlives_the_process(opened):
    opened().put(*payloads(10)).spool.close()
    later = opened()
    assert later.spool.waiting == 10
    assert [payload for _, payload in later.online().drain()] == payloads(10)
    assert opened().spool.waiting == 0


def test_all_that_was_taken_is_on_disk_when_it_is_closed(opened):
    count = 2 * MOST_ROWS + 10
    opened().online().put(*payloads(count)).spool.close()
    assert opened().spool.waiting == count


def test_a_killed_process_loses_nothing_that_was_on_disk_and_keeps_the_order(tmp_path, opened):
    command = [sys.executable, "-c", KILLED, tmp_path / "state"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as dying:
        for _ in range(4):
            on_disk = int(dying.stdout.readline())
        dying.kill()
    assert dying.returncode == -signal.SIGKILL
    spool = opened(clock=SystemClock())
    spool.spool.go_online()
    sent = spool.drain()
    for part in range(3):
        numbers = [int(payload) for topic, payload in sent if topic == f"t/{part}"]
        assert numbers == list(range(part, part + 3 * len(numbers), 3))
        assert numbers[-1] >= on_disk - 3


def test_what_the_cloud_took_is_not_sent_again_after_a_restart(opened):
    first = opened().put(*payloads(10)).written().online()
    first.send()
    first.send()
    first.written()
    assert opened().spool.waiting == 0


def test_more_than_fits_in_memory_waits_on_disk_and_memory_stays_flat(opened):
    spool = opened(messages=50)
    for number in range(2000):
        spool.put(b"%d" % number, topic=f"t/{number % 4}")
        if number % 50 == 0:
            spool.written()
    spool.written()
    assert spool.spool._queue._memory.count <= 50
    assert spool.spool.figures().classes[TrafficClass.EVENT].on_disk == 1950
    sent = spool.online().drain()
    for part in range(4):
        assert [int(payload) for topic, payload in sent if topic == f"t/{part}"] == [*range(part, 2000, 4)]


def test_its_size_is_bounded_and_what_matters_least_goes_first_and_is_reported(tmp_path, opened):
    size = 1024 * 1024
    spool = opened(size=size, messages=200)
    spool.put(*[b"s" * 1000] * 100, topic="status", traffic=TrafficClass.STATUS).written()
    for _ in range(40):
        spool.put(*[b"e" * 1000] * 100, topic="event").written()
    assert (tmp_path / "state" / SPOOL).stat().st_size <= size
    assert spool.spool.problem == ""
    gaps = {(gap.topic, gap.reason): gap.lost for gap in spool.spool.take_gaps()}
    assert set(gaps) == {("event", Reason.ROOM)}
    kept = opened(size=size).online().drain()
    assert sum(topic == "status" for topic, _ in kept) == 100
    assert sum(topic == "event" for topic, _ in kept) == 4000 - gaps["event", Reason.ROOM]


def test_losses_that_are_not_reported_yet_outlive_the_process(opened, clock):
    spool = opened().put(b"0", b"1")
    clock.advance(AGES[TrafficClass.EVENT])
    spool.spool.tick()
    assert spool.written().spool.lost == 2
    spool = opened()
    (gap,) = spool.spool.take_gaps()
    assert (gap.topic, gap.reason, gap.lost) == ("t", Reason.AGE, 2)
    spool.written()
    assert opened().spool.take_gaps() == []


def test_what_grew_too_old_while_nothing_ran_is_dropped_and_reported(opened, clock):
    opened().put(*payloads(20)).put(b"young", topic="u").written()
    clock.advance(AGES[TrafficClass.EVENT])
    spool = opened().put(b"new").online()
    clock.advance(EXPIRE_EVERY)
    assert spool.drain() == [("t", b"new")]
    spool.spool.tick()
    lost = {gap.topic: gap.lost for gap in spool.spool.take_gaps()}
    assert lost == {"t": 20, "u": 1}


@pytest.mark.parametrize("damage", ["rubbish", "cut", "no format of ours"])
def test_a_file_that_cannot_be_read_is_set_aside_and_reported(tmp_path, opened, damage):
    opened().put(*payloads(500)).written().spool.close()
    path = tmp_path / "state" / SPOOL
    if damage == "rubbish":
        path.write_bytes(b"rubbish" * 1000)
    elif damage == "cut":
        path.write_bytes(path.read_bytes()[:-10_000])
    else:
        with sqlite3.connect(path) as other:
            other.execute("PRAGMA user_version = -1")
        other.close()
    spool = opened()
    assert spool.spool.problem == f"{SPOOL} could not be read and was set aside as {SPOOL}.broken"
    assert (tmp_path / "state" / f"{SPOOL}.broken").exists()
    spool.put(b"new").written()
    wait_until("it is well again", lambda: not spool.spool.problem)
    assert spool.online().drain() == [("t", b"new")]


def test_two_edges_do_not_share_a_folder(tmp_path, opened):
    first = opened()
    with pytest.raises(StateError, match=f"another running edge \\(process {os.getpid()}\\)"):
        type(first)(tmp_path / "state", first.clock)


def test_its_figures_say_what_waits_of_each_class_since_when_also_from_before(opened, clock):
    began = clock.time()
    opened().put(b"old", traffic=TrafficClass.STATUS, topic="s").written()
    clock.advance(100.0)
    spool = opened()
    spool.put(b"young", b"younger").written()
    figures = spool.spool.figures()
    status, event = figures.classes[TrafficClass.STATUS], figures.classes[TrafficClass.EVENT]
    assert (status.messages, status.on_disk, event.messages, event.on_disk) == (1, 1, 2, 0)
    assert (status.oldest, event.oldest) == pytest.approx((began, began + 100.0), abs=0.001)
    assert event.memory == len(b"youngyounger")
    assert figures.classes[TrafficClass.REPLY].oldest is None
    assert 0 < figures.disk < 1_000_000
