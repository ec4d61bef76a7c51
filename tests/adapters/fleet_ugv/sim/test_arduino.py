"""A simulated ros_arduino_bridge: its words and answers, its encoders, and its stop after two seconds."""

import pytest

from fleet_ugv.sim.arduino import ArduinoBoard
from fleet_ugv.sim.physics import BaseBody

BODY = BaseBody(track=0.3, lag=0.0, sticks=0.0, fastest=2.0)
TICKS = 3000.0  # a metre: one tick in each period of 1/30 s is 0.01 m/s


@pytest.fixture
def board():
    return ArduinoBoard(BODY, ticks=TICKS)


def test_a_speed_is_in_ticks_per_period_of_a_thirtieth_of_a_second(board):
    assert board.receive(b"m 30 -20\r", 0.0) == b"OK\r\n"
    assert board.physics.wanted == pytest.approx([0.3, -0.2])


def test_the_encoders_count_ticks_and_are_reset_on_request(board):
    board.receive(b"m 30 60\r", 0.0)
    assert board.receive(b"e\r", 1.005) == b"900 1800\r\n"
    assert board.receive(b"r\re\r", 1.0) == b"OK\r\n0 0\r\n"


def test_counters_run_backwards_when_the_wheels_do(board):
    board.receive(b"m -30 0\r", 0.0)
    assert board.receive(b"e\r", 1.005) == b"-900 0\r\n"


def test_it_stops_two_seconds_after_its_last_speed_whatever_else_it_is_asked(board):
    board.receive(b"m 30 30\r", 0.0)
    board.receive(b"e\r", 1.9)
    board.step(2.0)
    assert (board.physics.wanted, board.halted_at) == (pytest.approx([0.3, 0.3]), None)
    board.step(2.05)
    assert board.physics.wanted == [0.0, 0.0]
    assert board.halted_at == pytest.approx(2.01, abs=0.011)


@pytest.mark.parametrize(
    ("word", "answer"),
    [
        (b"\r", b""),
        (b"b\r", b"57600\r\n"),
        (b"u 20 12 0 50\r", b"OK\r\n"),
        (b"s 1 90\r", b"OK\r\n"),
        (b"x\r", b"Invalid Command\r\n"),
        (b"\xff\xfe\r", b"Invalid Command\r\n"),
        (b"e", b""),
    ],
)
def test_each_word_has_its_answer(board, word, answer):
    assert board.receive(word, 0.0) == answer
    assert board.physics.wanted == [0.0, 0.0]


def test_a_servo_is_turned_by_its_number(board):
    board.receive(b"s 2 107\r", 0.0)
    assert board.servos == {2: 107}


@pytest.mark.parametrize(
    ("word", "wanted"),
    [
        (b"m 30\r", [0.3, 0.0]),  # an argument that is lost is 0
        (b"m\r", [0.0, 0.0]),
        (b"m 30x30\r", [0.3, 0.0]),  # a space that is spoiled
        (b"m 3?0 30\r", [0.03, 0.3]),
        (b"m x 30\r", [0.0, 0.3]),
        (b"m +30 -30\r", [0.3, -0.3]),
        (b"m 30 30 99\r", [0.3, 0.3]),
    ],
)
def test_a_spoiled_number_is_read_as_c_reads_it(board, word, wanted):
    assert board.receive(word, 0.0) == b"OK\r\n"
    assert board.physics.wanted == pytest.approx(wanted)


@pytest.mark.parametrize("cut", range(1, 8))
def test_a_word_may_come_in_parts(board, cut):
    assert board.receive(b"m 30 30\r"[:cut], 0.0) + board.receive(b"m 30 30\r"[cut:], 0.0) == b"OK\r\n"
    assert board.physics.wanted == pytest.approx([0.3, 0.3])


def test_a_word_that_is_too_long_is_cut_and_the_next_one_is_whole(board):
    assert board.receive(b"x" * 500, 0.0) == b""
    assert board.receive(b"\re\r", 0.0) == b"Invalid Command\r\n0 0\r\n"
    assert board.receive(b"m 30 " + b"0" * 40 + b"30\r", 0.0) == b"OK\r\n"
    assert board.physics.wanted == pytest.approx([0.3, 0.0])


def test_it_never_speaks_unasked(board):
    assert [board.step(now / 10) for now in range(50)] == [b""] * 50


def test_a_reset_stands_still_and_forgets_its_counters_and_half_a_word(board):
    board.receive(b"m 30 30\rm 9", 0.0)
    board.step(1.0)
    board.restart(1.0)
    assert board.physics.wanted == [0.0, 0.0]
    assert board.receive(b"e\r", 1.0) == b"0 0\r\n"
