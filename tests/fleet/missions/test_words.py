"""Runs in words: every phase and outcome has a sentence, and steps are called as in the mission."""

import pytest

from fleet.missions.state import PartOutcome, Phase
from fleet.missions.words import OUTCOMES, PHASES, log_line, phase_words, step_of


def test_every_phase_and_every_outcome_has_its_words():
    assert set(PHASES) == set(Phase)
    assert set(OUTCOMES) == set(PartOutcome)


@pytest.mark.parametrize(
    ("name", "step"),
    [("up.1", "up"), ("up.12", "up"), ("in.up.3", "in.up"), ("up", "up"), ("v1.2.3", "v1.2"), ("", "")],
)
def test_a_step_is_called_without_the_number_of_its_repetition(name, step):
    assert step_of(name) == step


@pytest.mark.parametrize(
    ("phase", "words"),
    [
        ("step", "carries out step up"),
        ("asking", "asks a person in step up"),
        ("ended", "has ended"),
        ("flying", "flying"),
    ],
)
def test_a_phase_is_told_with_the_step_and_an_unknown_one_as_it_is(phase, words):
    assert phase_words(phase, "up.3") == words


@pytest.mark.parametrize(
    ("robot", "step", "line"),
    [
        ("rex", "up.1", "rex begins goto (step up)"),
        ("rex", "", "rex begins goto"),
        ("", "up.1", "begins goto (step up)"),
        ("", "", "begins goto"),
    ],
)
def test_a_line_of_the_log_says_who_and_where(robot, step, line):
    assert log_line("begins goto", robot, step) == line
