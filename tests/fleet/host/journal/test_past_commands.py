"""Answers to repeats of commands of earlier processes."""

from fleet.host.journal.past_commands import PastCommand, answer_to
from fleet.model.command import ReplyStatus


def test_a_repeat_of_a_command_that_failed_is_refused_with_how_it_ended():
    answer = answer_to(PastCommand("r1", "land", False, "failed"))
    assert answer.first.status is ReplyStatus.REJECTED
    assert "ended failed" in answer.reason


def test_a_repeat_of_a_command_that_was_done_is_answered_as_done():
    assert answer_to(PastCommand("r1", "land", False, "completed")).ended.done is True
