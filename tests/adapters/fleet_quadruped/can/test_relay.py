"""Frames of the body controller on their way to a recorder: only while they are wanted, never waited for."""

import logging
import socket

import pytest

from fleet import CanFrame
from fleet.clock import SystemClock
from fleet.link.tap import OPENING, FrameTap, LinkFrames
from fleet.runtime.decoding import decode_json
from fleet_quadruped.can.capture import Captured
from fleet_quadruped.can.relay import RelaySender, received

FRAME = CanFrame(0x181, b"\x01\x02")


@pytest.fixture
def tap():
    tap = FrameTap(SystemClock())
    tap.switch(on=True)
    return tap


def flushed_frames(tap):
    """Return what is on its way to the bus."""
    put = []
    list(tap.flushing(put.append))
    return [
        frame for each in put for frame in decode_json(each, LinkFrames).frames if frame.direction != "open"
    ]


async def relayed(tap, cycles):
    """Let a body controller have some cycles; returns what its adapter leaves for the recorder."""
    OPENING.set(lambda link: tap.open("rex", link, lambda: None))
    async with received(["a"], logging.getLogger("rex")) as receiver:
        sender = RelaySender(receiver.relay)
        for wanted in cycles:
            sender.add(Captured(100.5, "a", FRAME, sent=False))
            sender.end_cycle(wanted=wanted)
        receiver.read()
        return flushed_frames(tap)


async def test_frames_keep_their_time_and_direction(tap):
    (frame,) = await relayed(tap, [True])
    assert (frame.at, frame.direction, CanFrame.unpack(frame.data)) == (100.5, "in", FRAME)


async def test_after_a_cycle_in_which_nobody_wants_them_none_are_passed_on(tap):
    assert len(await relayed(tap, [True, False, False, False])) == 2


async def test_the_adapter_wants_them_while_somebody_records(tap):
    OPENING.set(lambda link: tap.open("rex", link, lambda: None))
    async with received(["a"], logging.getLogger("rex")) as receiver:
        assert receiver.wanted()
        tap.switch(on=False)
        assert not receiver.wanted()


def test_what_does_not_fit_is_dropped_and_not_waited_for():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        theirs.setblocking(False)
        sender = RelaySender(theirs)
        for _ in range(20_000):
            sender.add(Captured(1.0, "a", FRAME, sent=True))
            sender.end_cycle(wanted=True)
    assert sender.dropped > 0


async def test_an_adapter_that_was_behind_says_how_many_were_dropped(tap, caplog):
    OPENING.set(lambda link: tap.open("rex", link, lambda: None))
    async with received(["a"], logging.getLogger("rex")) as receiver:
        sender = RelaySender(receiver.relay)
        while not sender.dropped:
            sender.add(Captured(1.0, "a", FRAME, sent=True))
            sender.end_cycle(wanted=True)
        while "were not recorded" not in caplog.text:
            receiver.read()
            sender.add(Captured(1.0, "a", FRAME, sent=True))
            sender.end_cycle(wanted=True)
