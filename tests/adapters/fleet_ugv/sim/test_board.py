"""What all simulated boards share: their time, their dead-man, and the faults of base and wire."""

import pytest

from fleet_ugv.sim.board import JUNK, SimBoard
from fleet_ugv.sim.physics import STEP, BaseBody

BODY = BaseBody(track=0.2, lag=0.0, sticks=0.0, fastest=2.0)


class Parrot(SimBoard):
    """A board that answers what it heard in capital letters, and says ``news`` in each step."""

    def __init__(self, timeout=0.5):
        super().__init__(BODY, timeout=timeout, voltage=12.0)
        self.heard, self.news, self.restarts = [], b"", []

    def handle_bytes(self, data, now):
        self.heard.append((data, now))
        return data.upper()

    def speak(self, now):
        return self.news

    def restart(self, now):
        self.restarts.append(now)


@pytest.fixture
def board():
    return Parrot()


def test_what_it_hears_is_answered_at_once_and_its_news_come_with_time(board):
    board.news = b"news"
    assert board.receive(b"go", 0.1) == b"GO"
    assert board.step(0.2) == b"news"
    assert board.heard == [(b"go", 0.1)]


def test_its_base_moves_with_the_time_that_passes_step_by_step(board):
    board.hold(0.4, 0.4, 0.0)
    board.receive(b"x", 0.1)
    assert board.physics.x == pytest.approx(0.04, abs=0.4 * STEP)
    board.step(0.1)
    assert board.physics.x == pytest.approx(0.04, abs=0.4 * STEP)
    board.step(0.4)
    assert board.physics.x == pytest.approx(0.16, abs=0.4 * STEP)


@pytest.mark.parametrize("seen", [0.6, 5.0])
def test_its_dead_man_acts_at_its_own_time_however_late_it_is_looked_at(board, seen):
    board.hold(0.4, 0.4, 0.0)
    board.step(seen)
    assert board.physics.wanted == [0.0, 0.0]
    assert board.halted_at == pytest.approx(0.51, abs=STEP)
    assert board.physics.x == pytest.approx(0.2, abs=0.01)


def test_each_command_feeds_the_dead_man(board):
    for tenth in range(20):
        board.hold(0.4, 0.4, tenth / 10)
        board.step(tenth / 10 + 0.05)
    assert (board.halted_at, board.physics.wanted) == (None, [0.4, 0.4])


def test_a_base_that_stands_is_not_halted(board):
    board.step(5.0)
    assert board.halted_at is None


def test_a_base_that_is_moved_again_is_no_longer_halted(board):
    board.hold(0.4, 0.4, 0.0)
    board.step(1.0)
    board.hold(0.4, 0.4, 1.0)
    assert board.halted_at is None


@pytest.mark.parametrize(
    ("name", "answer", "news"),
    [
        ("mute", b"", b""),
        ("echo", b"goGO", b"news"),
        ("garbage", JUNK + b"\nGO", JUNK + b"\nnews"),
        ("silent", b"", b""),
        ("loss", b"", b""),
        ("duplicate", b"GOGOGOGO", b"newsnews"),
    ],
)
def test_a_fault_of_its_wire_shows_in_what_is_heard(board, name, answer, news):
    board.set_fault(name, 1.0)
    board.news = b""
    assert board.receive(b"go", 0.1) == answer
    board.news = b"news"
    assert board.step(0.2) == news
    board.set_fault(name, None)
    assert board.receive(b"go", 0.3) == b"GO"


def test_a_mute_board_still_obeys(board):
    board.set_fault("mute", 1.0)
    board.receive(b"go", 0.1)
    assert board.heard == [(b"go", 0.1)]


def test_a_piece_that_is_cut_in_two_arrives_whole_in_the_end(board):
    board.set_fault("partial", 1.0)
    assert board.receive(b"abcdef", 0.1) == b"ABC"
    assert board.step(0.2) == b"D"
    board.set_fault("partial", None)
    assert board.step(0.3) == b"EF"


def test_a_delay_is_that_of_both_directions(board):
    board.set_fault("delay", 0.1)
    assert board.receive(b"go", 0.0) == b""
    assert board.step(0.05) == b""
    assert board.heard == []
    assert board.step(0.11) == b""
    assert board.heard == [(b"go", 0.11)]
    assert board.step(0.22) == b"GO"


def test_the_wheels_of_a_base_that_is_stalled_stand_until_the_fault_is_over(board):
    board.hold(0.4, 0.4, 0.0)
    board.set_fault("stall", 1.0)
    board.step(0.2)
    assert board.physics.x == 0.0
    board.set_fault("stall", None)
    board.step(0.3)
    assert board.physics.x > 0.0


def test_wheels_slip_by_their_share(board):
    board.set_fault("slip", 0.25)
    board.hold(0.4, 0.4, 0.0)
    board.step(0.4)
    assert board.physics.x == pytest.approx(0.75 * board.physics.distances[0])
    board.set_fault("slip", None)
    assert board.physics.slip == 0.0


def test_a_momentary_fault_is_over_when_it_has_begun(board):
    board.step(0.3)
    board.set_fault("reset", 1.0)
    board.set_fault("bump", 0.5)
    board.set_fault("low_battery", 9.5)
    assert (board.restarts, board.voltage, board.faults) == ([pytest.approx(0.3, abs=STEP)], 9.5, {})
    board.step(1.0)
    assert board.physics.yaw == pytest.approx(0.5, abs=0.001)


@pytest.mark.parametrize(
    ("name", "value", "expected"), [("los", 0.1, "did you mean 'loss'"), ("loss", 2.0, "loss: 2")]
)
def test_a_fault_that_there_is_not_is_refused(board, name, value, expected):
    with pytest.raises(ValueError, match=expected):
        board.set_fault(name, value)
    assert board.faults == {}
