import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import LinkLost, NotReady
from fleet.link.latest_motion import LatestMotion
from fleet.link.motion_sender import POLL_INTERVAL, MotionSender
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.testing.clock import ManualClock

SLOW, FAST = Velocity(Vector3(0.1)), Velocity(Vector3(0.9))


class Bench:
    """A motion on a wire that keeps what it is told; ``busy``: bytes that have not left."""

    def __init__(self, *, idle=False):
        self.clock, self.said, self.busy, self.lost, self.during_encode = ManualClock(), [], 0, False, None
        self.url = "wire"
        self.motion = MotionSender(
            LatestMotion(self, self.clock),
            self.clock,
            encode=self.encode,
            stop=lambda: (b"STOP",),
            every=0.1,
            idle=idle,
        )

    def encode(self, velocity):
        if self.during_encode:
            self.during_encode()
        return (b"%.1f" % velocity.linear.x,)

    def send(self, data, address=None):
        if self.lost:
            raise LinkLost("gone")
        self.said.append(data)
        return True

    def unsent(self):
        return self.busy

    def after(self, seconds):
        """Return what is written in the next seconds."""
        self.said.clear()
        for _ in range(round(seconds / POLL_INTERVAL)):
            self.clock.advance(POLL_INTERVAL)
            self.motion.poll()
        return list(self.said)


@pytest.fixture
def bench():
    return Bench()


def test_a_velocity_is_kept_up_and_the_newest_takes_its_place(bench):
    bench.motion.drive(SLOW)
    bench.motion.drive(FAST)
    assert bench.said == [b"0.1", b"0.9"]
    assert bench.after(0.3) == [b"0.9"] * 3


def test_one_that_is_renewed_in_time_is_not_written_more_often(bench):
    said = []
    for _ in range(10):
        bench.motion.drive(SLOW)
        said += bench.after(0.06)
    assert said == []


def test_a_zero_and_a_stop_are_repeated_a_few_times_only(bench):
    bench.motion.drive(ZERO_VELOCITY)
    assert bench.after(2.0) == [b"0.0"] * 5
    bench.motion.halt()
    assert bench.after(2.0) == [b"STOP"] * 5


def test_a_robot_that_wants_reports_at_rest_gets_them():
    assert Bench(idle=True).after(1.0) == [b"STOP"] * 10


def test_a_command_ends_what_was_kept_up(bench):
    bench.motion.drive(FAST)
    bench.motion.carry_out((b"DOCK",), bench.motion.turn)
    assert bench.said == [b"0.9", b"DOCK"]
    assert bench.after(2.0) == []


def test_what_was_decided_before_a_halt_is_not_written_after_it(bench):
    bench.motion.drive(SLOW)
    bench.during_encode = bench.motion.halt
    with pytest.raises(NotReady, match="stopped meanwhile"):
        bench.motion.drive(FAST)
    bench.during_encode = None
    assert bench.after(2.0) == [b"STOP"] * 5
    turn = bench.motion.turn
    bench.motion.halt()
    with pytest.raises(NotReady, match="stopped meanwhile"):
        bench.motion.carry_out((b"DOCK",), turn)


def test_a_halt_between_two_looks_ends_the_keeping_up(bench):
    bench.motion.drive(FAST)
    bench.during_encode = bench.motion.halt
    assert b"0.9" not in bench.after(0.12)


def test_a_robot_that_is_slow_to_read_finds_the_newest(bench):
    bench.motion.drive(SLOW)
    bench.busy = 50
    for tenth in range(9):
        bench.motion.drive(Velocity(Vector3(tenth / 10)))
    assert bench.after(0.06) == []
    bench.busy = 0
    assert bench.after(POLL_INTERVAL) == [b"0.8"]


def test_a_link_that_is_gone_is_not_ready_and_a_halt_does_not_fail(bench):
    bench.lost = True
    with pytest.raises(NotReady, match="gone"):
        bench.motion.drive(FAST)
    bench.motion.halt()


REQUESTS = st.lists(st.sampled_from(["drive", "halt", "look", "busy", "free", "dock"]), max_size=40)


@given(REQUESTS)
def test_whatever_is_asked_no_velocity_follows_a_halt_but_a_newer_one(requests):
    bench, newest = Bench(), None
    for number, request in enumerate(requests):
        bench.said.clear()
        match request:
            case "drive":
                newest = number
                bench.motion.drive(Velocity(Vector3(float(number))))
            case "halt":
                newest = None
                bench.motion.halt()
            case "dock":
                newest = None
                bench.motion.carry_out((b"DOCK",), bench.motion.turn)
            case "look":
                bench.after(0.1)
            case _:
                bench.busy = 99 if request == "busy" else 0
        moving = {said for said in bench.said if said not in {b"STOP", b"DOCK"}}
        assert moving <= {b"%.1f" % newest} if newest is not None else not moving
