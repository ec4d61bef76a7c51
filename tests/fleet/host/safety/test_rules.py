"""The small rules: repeats, the control lease, limits, the dead-man, the latch."""

import math

from hypothesis import given
from hypothesis import strategies as st

from fleet.host.safety.control_lease import ControlLease
from fleet.host.safety.deadman import DeadMan
from fleet.host.safety.dedup_cache import KEPT, LIFETIME, DedupCache
from fleet.host.safety.emergency_stop import EmergencyStopLatch
from fleet.host.safety.velocity_limits import clamp
from fleet.model.geometry import Vector3, Velocity
from fleet.robot_config import Limits

SPEEDS = st.floats(-100, 100)
VELOCITIES = st.builds(Velocity, st.builds(Vector3, SPEEDS, SPEEDS, SPEEDS), SPEEDS)
SOME_LIMITS = st.builds(
    Limits,
    speed=st.none() | st.floats(0.01, 50),
    vertical_speed=st.none() | st.floats(0.01, 50),
    yaw_rate=st.none() | st.floats(0.01, 50),
)


def test_a_repeat_is_known_and_gets_the_first_answer():
    repeats = DedupCache()
    assert repeats.first("a", "the first answer", 0.0) is None
    assert repeats.first("a", "another", 1.0) == "the first answer"


def test_a_message_without_an_id_is_never_a_repeat():
    repeats = DedupCache()
    assert repeats.first("", "an answer", 0.0) is None
    assert repeats.first("", "an answer", 0.0) is None


def test_repeats_are_forgotten_after_their_lifetime_and_beyond_their_number():
    repeats = DedupCache()
    repeats.first("old", "answer", 0.0)
    for number in range(KEPT):
        repeats.first(str(number), "answer", LIFETIME + 1)
    assert repeats.first("old", "answer", LIFETIME + 1) is None
    assert len(repeats._seen) <= KEPT


def test_the_one_who_moves_the_robot_keeps_it_for_a_while():
    lease = ControlLease(3.0)
    lease.take("anna", 0.0)
    assert lease.refusal("anna", 1.0) is None
    assert lease.refusal("bert", 2.0) == "anna has control for 1.0 s more"
    assert lease.refusal("bert", 3.0) is None


def test_a_freed_lease_is_anybodys():
    lease = ControlLease(3.0)
    lease.take("anna", 0.0)
    lease.free()
    assert lease.refusal("bert", 0.0) is None


@given(VELOCITIES, SOME_LIMITS)
def test_a_clamped_velocity_is_within_the_limits_and_keeps_its_direction(velocity, limits):
    clamped = clamp(velocity, limits)
    assert clamped.gait == velocity.gait
    assert clamped.linear.horizontal() <= (limits.speed or math.inf) * (1 + 1e-9)
    assert abs(clamped.linear.z) <= (limits.vertical_speed or math.inf) * (1 + 1e-9)
    assert abs(clamped.yaw_rate) <= (limits.yaw_rate or math.inf) * (1 + 1e-9)
    cross = velocity.linear.x * clamped.linear.y - velocity.linear.y * clamped.linear.x
    assert abs(cross) <= 1e-6 * (1 + velocity.linear.horizontal() ** 2)


@given(VELOCITIES)
def test_without_limits_nothing_is_changed(velocity):
    assert clamp(velocity, Limits()) == velocity


def test_a_lease_that_runs_out_is_told_once():
    deadman = DeadMan()
    deadman.feed(0.0, 0.5)
    assert not deadman.expire(0.49)
    assert deadman.expire(0.5)
    assert not deadman.expire(9.0)
    assert deadman.expired == 1


@given(st.lists(st.tuples(st.sampled_from(["feed", "clear", "look"]), st.floats(0, 1)), max_size=60))
def test_nothing_is_held_longer_than_its_lease(steps):
    deadman, now, until = DeadMan(), 0.0, math.inf
    for step, wait in steps:
        now += wait
        if step == "feed":
            deadman.feed(now, 0.5)
            until = now + 0.5
        elif step == "clear":
            deadman.clear()
            until = math.inf
        else:
            assert deadman.expire(now) == (now >= until)
            until = math.inf if now >= until else until


@given(
    st.lists(
        st.tuples(st.sampled_from(["feed", "clear", "expire", "move"]), st.integers(0, 2), st.floats(0, 1))
    )
)
def test_who_looks_through_those_that_run_misses_none_whatever_happens(steps):
    deadmen, together, now = [DeadMan() for _ in range(3)], set(), 0.0
    watched = set()
    for step, which, wait in steps:
        now += wait
        one = deadmen[which]
        if step == "feed":
            one.feed(now, 0.5)
        elif step == "clear":
            one.clear()
        elif step == "expire":
            one.expire(now)
        else:
            watched ^= {one}
            one.join(together if one in watched else set())
        assert together == {each for each in watched if each.armed}


def test_a_latch_stays_until_it_is_released_and_names_the_first_reason():
    latch = EmergencyStopLatch()
    latch.engage("the console")
    latch.engage("the cloud")
    assert latch.set
    assert "the console" in (latch.refusal() or "")
    latch.release()
    assert latch.refusal() is None
