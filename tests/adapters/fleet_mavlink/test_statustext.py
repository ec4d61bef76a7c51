"""Sentences of the autopilot, whole again."""

from fleet_mavlink.messages import StatusTextMessage
from fleet_mavlink.statustext import StatusTextAssembler

FULL = "Arming denied: Resolve system health failures firs"


def test_a_short_sentence_comes_at_once():
    (said,) = StatusTextAssembler().feed(StatusTextMessage(2, "PreArm: Need Position Estimate"), 5.0)
    assert (said.text, said.severity, said.at) == ("PreArm: Need Position Estimate", 2, 5.0)


def test_pieces_become_one_sentence_without_the_tab_at_its_end():
    joiner = StatusTextAssembler()
    assert joiner.feed(StatusTextMessage(2, FULL, 3, 0), 1.0) == []
    (said,) = joiner.feed(StatusTextMessage(2, "t\t", 3, 1), 1.1)
    assert said.text == "Arming denied: Resolve system health failures first"


def test_pieces_may_come_out_of_order():
    joiner = StatusTextAssembler()
    assert joiner.feed(StatusTextMessage(2, "t\t", 3, 1), 1.0) == []
    assert [said.text for said in joiner.feed(StatusTextMessage(2, FULL, 3, 0), 1.1)] == [FULL + "t"]


def test_pieces_of_two_sentences_are_kept_apart():
    joiner = StatusTextAssembler()
    joiner.feed(StatusTextMessage(2, "a" * 50, 1, 0), 1.0)
    joiner.feed(StatusTextMessage(4, "b" * 50, 2, 0), 1.0)
    assert [said.text for said in joiner.feed(StatusTextMessage(4, "!", 2, 1), 1.0)] == ["b" * 50 + "!"]
    assert [said.text for said in joiner.feed(StatusTextMessage(2, "?", 1, 1), 1.0)] == ["a" * 50 + "?"]


def test_a_piece_that_never_comes_is_waited_for_one_second_and_marked():
    joiner = StatusTextAssembler()
    joiner.feed(StatusTextMessage(2, FULL, 3, 0), 1.0)
    joiner.feed(StatusTextMessage(2, "end", 3, 2), 1.0)
    assert joiner.late(1.9) == []
    assert [said.text for said in joiner.late(2.1)] == [FULL + "[...]end"]
    assert joiner.late(9.0) == []


def test_a_sentence_that_fills_its_last_piece_ends_after_a_second():
    joiner = StatusTextAssembler()
    assert joiner.feed(StatusTextMessage(6, "x" * 50, 9, 0), 1.0) == []
    assert [said.text for said in joiner.late(2.5)] == ["x" * 50]


def test_unfinished_sentences_do_not_pile_up():
    joiner = StatusTextAssembler()
    released = [
        said for key in range(1, 100) for said in joiner.feed(StatusTextMessage(6, "y" * 50, key, 0), 1.0)
    ]
    assert len(released) >= 90
    assert len(joiner.late(9.0)) == 99 - len(released)


def test_silence_is_no_sentence():
    assert StatusTextAssembler().feed(StatusTextMessage(6, " \t"), 1.0) == []
