"""Who is told what about a request: the receipt, the end, and what is not worth a message."""

import json
import logging

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.bridge.command_replies import (
    LONGEST_CORRELATION,
    SAME_REFUSAL_EVERY,
    STREAMED,
    CommandReplies,
    MessageReplies,
    _text,
)
from fleet.model.command import Reply, ReplyStatus
from fleet.runtime.rate_limited_counter import RateLimitedCounter

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
T = f"cyberwave/twin/{TWIN}"
INBOX = f"{T}/command/anna/response"
ACCEPTED, REJECTED, DENIED = ReplyStatus.ACCEPTED, ReplyStatus.REJECTED, ReplyStatus.DENIED


class Bench:
    """The replies, and what they publish."""

    def __init__(self, topics, port, clock):
        self.port = port
        self.sent = []
        self.refusals = RateLimitedCounter(logging.getLogger("fleet.bridge"), clock)
        self.replies = CommandReplies(topics, self._send, self.refusals, clock)

    def _send(self, topic, payload, *, correlation=None):
        self.sent.append((topic, json.loads(payload), correlation))

    def senders(self, kind="command", *, inbox=None, correlation=None, once=False):
        return self.replies.senders(self.port, inbox, correlation, kind, once)

    def receipt(self, reply, **request):
        """Send a receipt; return the topics of what was published."""
        del self.sent[:]
        self.senders(**request)[0](reply)
        return [topic for topic, *_ in self.sent]

    def end(self, reply, **request):
        del self.sent[:]
        self.senders(**request)[1](reply)
        return [topic for topic, *_ in self.sent]


@pytest.fixture
def bench(topics, rex, clock):
    return Bench(topics, rex, clock)


LAND = Reply("land", ACCEPTED)


# -- the two replies to one message -------------------------------------------------------------------


def test_the_first_reply_is_the_receipt_and_all_later_ones_the_end():
    told, asked = [], []

    def senders():
        asked.append(1)
        return (lambda reply: told.append(("receipt", reply))), (lambda reply: told.append(("end", reply)))

    replies = MessageReplies(senders)
    assert (replies.answered, asked) == (False, [])
    for number in range(3):
        replies(number)
        assert replies.answered
    assert told == [("receipt", 0), ("end", 1), ("end", 2)]
    assert asked == [1]


# -- where to -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["command", "motion", "joints"])
def test_without_an_inbox_receipt_and_end_are_statuses_on_the_command_topic(bench, kind):
    assert bench.receipt(LAND, kind=kind) == [f"{T}/command"]
    assert bench.end(LAND, kind=kind) == [f"{T}/command"]


@pytest.mark.parametrize("kind", ["navigate", "mission"])
def test_goals_and_missions_have_statuses_of_their_own(bench, kind):
    assert (bench.receipt(LAND, kind=kind), bench.end(LAND, kind=kind)) == ([], [])
    assert bench.receipt(LAND, kind=kind, inbox=INBOX) == [INBOX]


def test_with_an_inbox_the_receipt_goes_there_and_the_end_to_all(bench, clock):
    assert bench.receipt(LAND, inbox=INBOX, correlation=b"q1") == [INBOX]
    ((_, message, correlation),) = bench.sent
    assert (message["contract"], message["status"], correlation) == (
        "twin.command_response.v1",
        "accepted",
        b"q1",
    )
    assert (message["twin_uuid"], message["source_type"], message["timestamp"]) == (
        TWIN,
        "edge",
        clock.time(),
    )
    assert bench.end(Reply("land", ACCEPTED, done=True), inbox=INBOX, correlation=b"q1") == [f"{T}/command"]
    ((_, message, correlation),) = bench.sent
    assert (message["done"], message["correlation_id"], correlation) == (True, "q1", None)


def test_the_inbox_of_somebody_else_gets_nothing_and_is_counted(bench, caplog):
    other = INBOX.replace("7c11", "7c12")
    assert bench.receipt(LAND, inbox=other) == []
    assert bench.end(LAND, inbox=other) == [f"{T}/command"]
    assert bench.refusals.counts() == {"foreign inbox": 2}
    assert f"rex: no reply to '{other}': it is not a reply inbox of this twin" in caplog.text


def test_a_long_inbox_is_shortened_in_the_log(bench, caplog):
    bench.receipt(LAND, inbox="x" * 10_000)
    assert len(caplog.messages[0]) < 250


def test_a_robot_that_is_configured_not_to_sends_no_status_but_answers_an_inbox(bench, rex):
    rex.legacy_status = False
    assert (bench.receipt(LAND), bench.end(LAND)) == ([], [])
    assert bench.receipt(LAND, inbox=INBOX) == [INBOX]
    assert bench.end(LAND, inbox=INBOX) == []


# -- video --------------------------------------------------------------------------------------------

VIDEO = f"{T}/start_video/status"


@pytest.mark.parametrize(
    ("reply", "more"),
    [
        (Reply("start_video", ACCEPTED), []),
        (Reply("start_video", ACCEPTED, done=True), [VIDEO]),
        (Reply("start_video", REJECTED, "no camera"), [VIDEO]),
        (Reply("start_video", DENIED, "no camera", done=False), [VIDEO]),
        (Reply("stop_video", ACCEPTED, done=True), [f"{T}/stop_video/status"]),
        (Reply("land", ACCEPTED, done=True), []),
        (Reply("land", REJECTED), []),
    ],
)
def test_the_result_of_a_video_command_goes_also_to_the_topic_of_the_command(bench, reply, more):
    assert bench.receipt(reply) == [f"{T}/command", *more]
    assert bench.end(reply) == [f"{T}/command", *more]
    assert bench.receipt(reply, inbox=INBOX) == [INBOX, *more]


def test_a_video_command_on_another_topic_is_no_video_command(bench):
    assert bench.receipt(Reply("start_video", ACCEPTED, done=True), kind="motion") == [f"{T}/command"]


# -- what is worth a message --------------------------------------------------------------------------


@pytest.mark.parametrize("command", sorted(STREAMED))
def test_the_success_of_a_setpoint_is_sent_only_if_it_is_no_stream_or_to_an_inbox(bench, command):
    reply = Reply(command, ACCEPTED)
    assert bench.receipt(reply) == []
    assert bench.receipt(reply, once=True) == [f"{T}/command"]
    assert bench.receipt(reply, inbox=INBOX) == [INBOX]


def test_the_same_refusal_of_setpoints_is_sent_once_a_second(bench, clock):
    reply = Reply("move", REJECTED, "stale")
    sent = []
    for _ in range(30):
        sent.append(len(bench.receipt(reply)))
        clock.advance(SAME_REFUSAL_EVERY / 10)
    assert sent == [1, *[0] * 9] * 3


def test_another_refusal_another_command_or_another_robot_is_sent_at_once(bench, ports):
    replies = [Reply("move", REJECTED), Reply("move", DENIED), Reply("turn_left", REJECTED)]
    assert [len(bench.receipt(reply)) for reply in replies * 2] == [1, 1, 1, 0, 0, 0]
    bench.port = next(port for port in ports.values() if port is not bench.port)
    bench.port.legacy_status = True
    assert len(bench.receipt(replies[0])) == 1


def test_every_refusal_of_a_command_that_is_no_stream_is_sent(bench):
    assert [len(bench.receipt(Reply("land", REJECTED))) for _ in range(3)] == [1, 1, 1]
    assert [len(bench.receipt(Reply("move", REJECTED), once=True)) for _ in range(3)] == [1, 1, 1]


# -- correlation --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("correlation", "text"),
    [
        (None, ""),
        (b"", ""),
        (b"c0ffee", "c0ffee"),
        (b"a b~", "a b~"),
        (b"a\n", ""),
        (b"\x7f", ""),
        ("\u00e4".encode(), ""),
        (b"\xff", ""),
        (b"x" * LONGEST_CORRELATION, "x" * LONGEST_CORRELATION),
        (b"x" * (LONGEST_CORRELATION + 1), ""),
    ],
)
def test_a_correlation_is_echoed_if_it_is_short_printable_ascii(bench, correlation, text):
    bench.receipt(LAND, correlation=correlation)
    assert bench.sent[0][1].get("correlation_id", "") == text


@given(st.binary(max_size=80))
def test_no_correlation_makes_a_reply_fail(correlation):
    text = _text(correlation)
    assert text == "" or text.encode() == correlation
