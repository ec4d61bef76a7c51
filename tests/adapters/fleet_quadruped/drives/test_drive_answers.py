import pytest

from fleet_quadruped.drives.drive_answers import DriveAnswers


def after(*cycles):
    """Return the answers to one id after cycles in which these came."""
    answers = DriveAnswers()
    for frames in cycles:
        answers.begin()
        for data in frames:
            answers.add(data)
    answers.begin()
    return answers


def test_two_different_answers_in_every_cycle_come_from_two_drives():
    assert after(*[(b"a", b"b")] * 5).doubled
    assert not after(*[(b"a", b"b")] * 4).doubled


@pytest.mark.parametrize("cycles", [[(b"a", b"a")] * 20, [(b"a", b"b"), ()] * 20, [(b"a",)] * 20])
def test_repeated_and_late_answers_come_from_one(cycles):
    assert not after(*cycles).doubled


def test_two_drives_stay_two_when_one_is_silent_for_a_while():
    assert after(*[(b"a", b"b")] * 5, (b"a",), ()).doubled


def test_a_cycle_is_complete_with_the_first_answer():
    answers = after()
    assert not answers.complete
    answers.add(b"a")
    assert answers.complete
