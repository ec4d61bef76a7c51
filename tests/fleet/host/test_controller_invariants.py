"""What holds at a controller whatever is asked, in whatever order, and however the robot comes and goes."""

import asyncio

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fleet.model.geometry import Velocity
from fleet.model.navigation import Control, Navigate

SOURCES = st.sampled_from(["tele", "edge", "sim", None])
SESSIONS = st.sampled_from(["anna", "bert"])
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("command"), st.sampled_from(["takeoff", "land", "shy", "battery_check", "dance"])),
        st.tuples(st.just("stop"), st.sampled_from(["stop", "emergency_stop", "hover"])),
        st.tuples(st.just("release"), st.none()),
        st.tuples(st.just("setpoint"), st.floats(-10, 10)),
        st.tuples(st.just("goal"), st.sampled_from(["", "a1", "a2"])),
        st.tuples(st.just("control"), st.sampled_from(list(Control))),
        st.tuples(st.just("wait"), st.floats(0, 4)),
        st.tuples(st.just("lost"), st.none()),
        st.tuples(st.just("found"), st.none()),
        st.tuples(st.just("authority"), st.none()),
    ),
    max_size=25,
)


def time_passes(bench, seconds):
    bench.clock.advance(seconds)
    if bench.controller.deadman.expire(bench.clock.monotonic()):
        bench.controller.halt()
        bench.controller.motion.lease_ran_out()


def the_pilot_takes_over(bench, _):
    bench.adapter.calls.append("halt")  # an adapter that loses the robot sends nothing more
    bench.controller.authority_lost("pilot")


EVENTS = {
    "wait": time_passes,
    "lost": lambda bench, _: bench.controller.lost("gone"),
    "found": lambda bench, _: bench.controller.found(),
    "authority": the_pilot_takes_over,
}
REQUESTED = {
    "command": lambda requests, name, **who: requests.command(name, **who),
    "stop": lambda requests, name, **who: requests.command(name, **who),
    "release": lambda requests, _, **who: requests.command("release_emergency_stop", **who),
    "setpoint": lambda requests, speed, **who: requests.setpoint(x=speed, **who),
    "goal": lambda requests, action, **who: requests.goal(action, **who),
    "control": lambda requests, what, **who: Navigate(what, "", requests.command("x", **who).origin),
}


async def play(bench, requests, steps, source, session):
    """Play the steps; yields each one's kind, the latch before, the answers, what the robot was told."""
    for kind, value in steps:
        before = len(bench.adapter.calls)
        latched, answers = bench.controller.latched, []
        if kind in REQUESTED:
            answers = bench.request(REQUESTED[kind](requests, value, source=source, session=session))
        else:
            EVENTS[kind](bench, value)
        await requests.settle()
        yield kind, latched, answers, bench.adapter.calls[before:]


def moves(calls):
    return [one for one in calls if (isinstance(one, Velocity) and not one.is_zero) or isinstance(one, tuple)]


EXAMPLES = settings(
    max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@EXAMPLES
@given(steps=STEPS, source=SOURCES, session=SESSIONS)
def test_every_ask_gets_exactly_one_receipt(make_bench, requests, steps, source, session):
    async def check():
        bench = make_bench()
        bench.adapter.go.set()
        async for kind, _, answers, _ in play(bench, requests, steps, source, session):
            assert len(answers) == (1 if kind in REQUESTED else 0)

    asyncio.run(check())


@EXAMPLES
@given(steps=STEPS, source=SOURCES, session=SESSIONS)
def test_nothing_moves_while_an_emergency_stop_is_latched(make_bench, requests, steps, source, session):
    async def check():
        bench = make_bench()
        async for kind, latched, _, calls in play(bench, requests, steps, source, session):
            assert not latched or kind == "release" or moves(calls) == []

    asyncio.run(check())


@EXAMPLES
@given(steps=STEPS, source=st.sampled_from(["sim", None, "edit"]), session=SESSIONS)
def test_nothing_ever_moves_for_a_source_that_is_not_obeyed(make_bench, requests, steps, source, session):
    async def check():
        bench = make_bench()
        async for _, _, _, calls in play(bench, requests, steps, source, session):
            assert moves(calls) == []

    asyncio.run(check())


@EXAMPLES
@given(steps=STEPS, source=SOURCES, session=SESSIONS)
def test_a_velocity_is_never_held_without_a_lease(make_bench, requests, steps, source, session):
    async def check():
        bench = make_bench()
        async for _ in play(bench, requests, steps, source, session):
            last = [one for one in bench.adapter.calls if one != "battery_check"][-1:]
            held = bool(last) and isinstance(last[0], Velocity) and not last[0].is_zero
            assert not held or bench.controller.deadman.armed

    asyncio.run(check())


@EXAMPLES
@given(steps=STEPS, source=SOURCES, session=SESSIONS)
def test_all_motion_ends_with_a_stop_a_loss_or_a_taking_over(make_bench, requests, steps, source, session):
    async def check():
        bench = make_bench()
        async for kind, _, _, _ in play(bench, requests, steps, source, session):
            assert kind not in {"stop", "lost", "authority"} or not bench.controller.in_motion

    asyncio.run(check())


@EXAMPLES
@given(steps=STEPS, source=SOURCES, session=SESSIONS)
def test_nothing_is_said_of_an_action_after_its_end(make_bench, requests, steps, source, session):
    async def check():
        bench = make_bench()
        async for _ in play(bench, requests, steps, source, session):
            pass
        said = [report for report in bench.reports if getattr(report, "action_id", "") == "a1"]
        states = [str(report.state) for report in said]
        ended = [index for index, report in enumerate(said) if report.state.terminal]
        repeats_of_the_end = states[ended[0] :] if ended else []
        assert len(set(repeats_of_the_end)) <= 1 or "queued" in repeats_of_the_end

    asyncio.run(check())
