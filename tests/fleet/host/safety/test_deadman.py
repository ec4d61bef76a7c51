"""A velocity lives for its lease and not a moment longer."""

import math

from hypothesis import given
from hypothesis import strategies as st

from fleet.host.safety.deadman import DeadMan


def test_a_lease_that_runs_out_is_reported_once():
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
