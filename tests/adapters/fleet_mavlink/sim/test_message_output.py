"""What an autopilot says: long texts in chunks, answers that get lost, and messages for later."""

import random
import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_mavlink.sim.ardupilot import ArduPilot
from fleet_mavlink.sim.command_request import CommandRequest
from fleet_mavlink.sim.message_output import CRITICAL, INFO, MessageOutput
from fleet_mavlink.sim.px4 import SimPx4

REQUEST = CommandRequest(400, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, None, 245, 191)


def speaker(kind=MessageOutput, **faults):
    return kind(random.Random(1), faults, 0.0)


class Px4Like(MessageOutput):
    """Says texts and answers as PX4 does."""

    ends_text, text_id_always = SimPx4.ends_text, SimPx4.text_id_always
    ack_delay, ack_queue = SimPx4.ack_delay, SimPx4.ack_queue


def test_a_text_that_fits_is_one_message_without_a_number():
    it = speaker()
    it.say(CRITICAL, "x" * 50)
    (said,) = it.out
    assert (said.severity, said.text, said.id, said.chunk_seq) == (2, "x" * 50, 0, 0)


def test_a_longer_text_is_said_in_numbered_chunks():
    it = speaker()
    it.say(INFO, "a" * 50 + "b" * 50 + "c")
    it.say(INFO, "d" * 51)
    assert [(said.id, said.chunk_seq, said.text[:1]) for said in it.out] == [
        (1, 0, "a"),
        (1, 1, "b"),
        (1, 2, "c"),
        (2, 0, "d"),
        (2, 1, "d"),
    ]


@given(st.integers(0, 200))
def test_no_character_of_a_text_is_lost(length):
    it, text = speaker(), string.printable * 2
    text = text[:length]
    it.say(INFO, text)
    assert "".join(said.text for said in it.out) == text


def test_px4_ends_its_texts_with_a_tabulator_and_numbers_them_all():
    it = speaker(Px4Like)
    it.say(INFO, "x" * 50)
    assert [(said.id, said.text) for said in it.out] == [(1, "x" * 50), (1, "\t")]


def test_a_text_that_is_said_once_is_said_again_only_after_a_boot():
    it = speaker()
    for text in ("low", "low", "lower"):
        it.send_text_once(INFO, text)
    assert [said.text for said in it.out] == ["low", "lower"]


def test_a_delayed_message_is_said_when_it_is_due_and_once():
    it = speaker()
    it.later(0.5, "second")
    it.later(0.2, "first")
    for now, said in ((0.1, []), (0.2, ["first"]), (0.5, ["second"]), (9.0, [])):
        it.out.clear()
        it.time = now
        it.send_due_texts()
        assert it.out == said


def test_ardupilot_answers_at_once_and_px4_a_moment_later():
    assert (ArduPilot.ack_delay, ArduPilot.ends_text) == (MessageOutput.ack_delay, MessageOutput.ends_text)
    it = speaker()
    it.acknowledge(REQUEST, 0)
    assert (it.out[0].command, it.out[0].target_system) == (400, 245)
    px4 = speaker(Px4Like)
    px4.acknowledge(REQUEST, 0)
    assert px4.out == []
    px4.time = SimPx4.ack_delay
    px4.send_due_texts()
    assert len(px4.out) == 1


def test_px4_loses_the_answers_that_do_not_fit_into_its_queue():
    it = speaker(Px4Like)
    for _ in range(20):
        it.acknowledge(REQUEST, 0)
    it.time = 1.0
    it.send_due_texts()
    assert len(it.out) == SimPx4.ack_queue == 4


def test_a_slow_answer_is_announced():
    it = speaker(slow_ack=2.0)
    it.acknowledge(REQUEST, 0)
    assert [answer.result for answer in it.out] == [5]
    it.time = 2.0
    it.send_due_texts()
    assert [answer.result for answer in it.out] == [5, 0]


@pytest.mark.parametrize(("faults", "answers"), [({"no_ack": 1.0}, 0), ({"ack_loss": 1.0}, 0), ({}, 100)])
def test_answers_get_lost_by_faults_only(faults, answers):
    it = speaker(**faults)
    for _ in range(100):
        it.acknowledge(REQUEST, 0)
    assert len(it.out) == answers


def test_a_part_of_the_answers_gets_lost():
    it = speaker(ack_loss=0.3)
    for _ in range(1000):
        it.acknowledge(REQUEST, 0)
    assert 640 < len(it.out) < 760
