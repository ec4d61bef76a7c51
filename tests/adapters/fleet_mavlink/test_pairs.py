"""One request soon after another, through the host: the answers are true, and nothing moves unasked."""

import itertools

import pytest

from tests.adapters.fleet_mavlink import pairs
from tests.adapters.fleet_mavlink.hosted import HostedSky

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
LATE = {"state_lag": 1.0}
MOMENTS = [  # where the first request is sent, s until the second, and faults of the link
    ("ground", 0.1, {}),
    ("hovering", 0.3, LATE),
    ("armed", 0.0, {}),
    ("climbing", 0.1, {"delay": 0.3}),
    ("landing", 0.0, LATE),
    ("hovering", 1.2, {}),
    ("failsafe", 0.6, {"ack_loss": 0.4}),
    ("ground", 2.5, {"state_lag": 1.5, "delay": 0.2}),
]
ROVER_MOMENTS = [("ground", 0.1, LATE), ("driving", 0.3, LATE), ("armed", 0.0, {}), ("driving", 1.2, {})]
ROVER_FIRST = [name for name in pairs.FIRST if name not in pairs.NOT_FOR_ROVERS]
ROVER_SECOND = [name for name in pairs.SECOND if name not in pairs.NOT_FOR_ROVERS]


@pytest.fixture(autouse=True)
def _one_thread(monkeypatch):
    """Write halts on the loop's thread: others do not know of its time."""
    monkeypatch.setattr(
        "fleet.host.robot.controller.call_sequentially", lambda calls, wait: [call() for call in calls]
    )


def some(moments, pair, *, every):
    """Return one of the moments, by turns from pair to pair; ``every``: all of them."""
    return moments if every else [moments[pair % len(moments)]]


def played(run_in_sim_time, flavour, first, second, moments, **more):
    """Play a pair at some moments; return what is wrong, with the answers."""
    wrong = []

    async def main(state, delay, faults):
        async with HostedSky(flavour, **more) as it:
            await it.wait_until_known()
            for name, value in faults.items():
                it.sim.set_fault(name, value)
            found, answers = await pairs.play(it, state, first, second, delay)
            wrong.extend((state, delay, faults, each, answers) for each in found)

    for moment in moments:
        run_in_sim_time(main(*moment))
    return wrong


PAIRS = list(itertools.product(pairs.FIRST, pairs.SECOND))
ROVER_PAIRS = list(itertools.product(ROVER_FIRST, ROVER_SECOND))


@pytest.mark.combinations
@both
@pytest.mark.parametrize("second", pairs.SECOND)
@pytest.mark.parametrize("first", pairs.FIRST)
def test_one_request_soon_after_another_to_a_multirotor(run_in_sim_time, request, flavour, first, second):
    every = request.config.getoption("--soak")
    moments = some(MOMENTS, PAIRS.index((first, second)), every=every)
    assert played(run_in_sim_time, flavour, first, second, moments) == []


@pytest.mark.combinations
@pytest.mark.parametrize("second", ROVER_SECOND)
@pytest.mark.parametrize("first", ROVER_FIRST)
def test_one_request_soon_after_another_to_a_rover(run_in_sim_time, request, first, second):
    every = request.config.getoption("--soak")
    moments = some(ROVER_MOMENTS, ROVER_PAIRS.index((first, second)), every=every)
    limits = {"speed": 3.0, "distance": 5000.0}
    assert played(run_in_sim_time, "ardupilot", first, second, moments, vehicle="rover", limits=limits) == []
