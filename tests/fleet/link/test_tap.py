"""Copies of frames: none while nobody records, bounded, in order, without secrets."""

import asyncio
import sys
import threading

import msgspec
import pytest

from fleet.link import tap as taps
from fleet.link.memory import MemoryRobot
from fleet.link.tap import OPENING, FrameTap, LinkFrames
from fleet.link.url import open_link
from fleet.testing.clock import ManualClock


@pytest.fixture
def frames():
    return FrameTap(ManualClock(time=100.0))


def flushed(frames):
    """Return the messages that a flush puts."""
    put = []
    list(frames.flushing(put.append))
    return [msgspec.json.decode(each, type=LinkFrames) for each in put]


def opened(frames, link="memory:rex", redaction=lambda: None):
    return frames.open("rex", link, redaction)


def test_nothing_is_copied_while_nobody_records(frames):
    tap = opened(frames)
    assert (tap.note, flushed(frames)) == (None, [])


def test_frames_are_copied_with_their_direction_and_time_from_when_it_is_switched_on(frames):
    tap = opened(frames)
    frames.switch(on=True)
    tap.note("out", b"go")
    tap.note("in", b"ok", ("10.0.0.2", 14550))
    tap.note("in", b"late", at=99.5)
    (message,) = flushed(frames)
    assert [(each.at, each.direction, each.data, each.peer) for each in message.frames] == [
        (100.0, "out", b"go", ""),
        (100.0, "in", b"ok", "10.0.0.2:14550"),
        (99.5, "in", b"late", ""),
    ]
    assert (message.robot, message.link, message.number, message.dropped) == ("rex", "memory:rex", 1, 0)


def test_a_link_that_is_opened_meanwhile_says_so(frames):
    frames.switch(on=True)
    opened(frames)
    assert [each.direction for each in flushed(frames)[0].frames] == ["open"]


def test_nothing_is_copied_once_nobody_records_any_more(frames):
    tap = opened(frames)
    frames.switch(on=True)
    tap.note("in", b"x")
    frames.switch(on=False)
    assert (tap.note, flushed(frames)) == (None, [])


def test_a_frame_of_a_thread_that_is_late_is_not_kept_once_nobody_records(frames):
    tap = opened(frames)
    frames.switch(on=True)
    note = tap.note  # as a link has it while another thread ends the recording
    frames.switch(on=False)
    note("out", b"late")
    assert flushed(frames) == []


def test_an_end_in_the_middle_of_a_flush_ends_that(frames, monkeypatch):
    monkeypatch.setattr(taps, "STEP", 1)
    tap = opened(frames)
    frames.switch(on=True)
    for _ in range(3):
        tap.note("out", b"go")
    flush = frames.flushing(lambda _: None)
    next(flush)
    frames.switch(on=False)
    list(flush)


def test_what_several_threads_note_while_it_is_flushed_leaves_nothing_counted_as_waiting(frames):
    tap, interval = opened(frames), sys.getswitchinterval()
    frames.switch(on=True)
    writers = [threading.Thread(target=lambda: [tap.note("out", b"go") for _ in range(5000)]) for _ in "abc"]
    count = 0
    sys.setswitchinterval(1e-6)
    try:
        for writer in writers:
            writer.start()
        while any(writer.is_alive() for writer in writers):
            count += sum(len(message.frames) for message in flushed(frames))
        count += sum(len(message.frames) for message in flushed(frames))
    finally:
        sys.setswitchinterval(interval)
    assert (count, frames._size) == (15000, 0)


def test_what_does_not_fit_is_dropped_and_counted(frames, monkeypatch):
    monkeypatch.setattr(taps, "MOST_WAITING", 1000)
    tap = opened(frames)
    frames.switch(on=True)
    for _ in range(10):
        tap.note("in", b"x" * 100)
    assert [(len(message.frames), message.dropped) for message in flushed(frames)] == [(4, 6)]
    tap.note("in", b"again")
    assert [each.data for each in flushed(frames)[0].frames] == [b"again"]


def test_much_is_put_in_several_numbered_messages(frames, monkeypatch):
    monkeypatch.setattr(taps, "LARGEST", 250)
    tap = opened(frames)
    frames.switch(on=True)
    for _ in range(5):
        tap.note("in", b"x" * 100)
    assert [(message.number, len(message.frames)) for message in flushed(frames)] == [(1, 3), (2, 2)]


def test_each_direction_is_redacted_by_itself(frames):
    tap = opened(frames, redaction=lambda: lambda data: data.replace(b"key", b"***"))
    frames.switch(on=True)
    tap.note("out", b"key=1")
    assert flushed(frames)[0].frames[0].data == b"***=1"


def test_frames_whose_redaction_fails_are_not_recorded(frames, caplog):
    def failing(_data):
        raise ValueError("no")

    tap = opened(frames, redaction=lambda: failing)
    frames.switch(on=True)
    tap.note("in", b"secret")
    assert flushed(frames) == []
    assert "redaction of memory:rex failed" in caplog.text


async def test_an_open_link_leaves_copies_of_what_it_carries(frames):
    token = OPENING.set(lambda link: opened(frames, link))
    heard = asyncio.Queue()
    try:
        with MemoryRobot("rex", lambda data: b"re:" + data) as robot:
            link = await open_link("memory:rex", lambda data, _address: heard.put_nowait(data))
            link.send(b"before")
            frames.switch(on=True)
            link.send(b"go")
            assert [await heard.get(), await heard.get()] == [b"re:before", b"re:go"]
            await link.close()
    finally:
        OPENING.reset(token)
    assert robot.heard == [b"before", b"go"]
    copies = [(each.direction, each.data) for each in flushed(frames)[0].frames]
    assert ("out", b"go") in copies
    assert ("in", b"re:go") in copies
