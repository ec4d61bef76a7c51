"""One request soon after another, through the host: the answers are true, and nothing moves unasked."""

import pytest

from tests.adapters.fleet_mavlink import pairs
from tests.adapters.fleet_mavlink.hosted import HostedSky

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])


def played(fly, flavour, state, first, second, delay, faults=None):
    """Play a pair; return what is wrong."""

    async def main():
        async with HostedSky(flavour) as it:
            await it.met()
            for name, value in (faults or {}).items():
                it.sim.set_fault(name, value)
            return await pairs.play(it, state, first, second, delay)

    return fly(main())


@pytest.mark.combinations
@both
@pytest.mark.parametrize("state", pairs.STATES)
@pytest.mark.parametrize("first", pairs.FIRST)
@pytest.mark.parametrize("second", pairs.SECOND)
@pytest.mark.parametrize("delay", pairs.DELAYS)
def test_one_request_soon_after_another(fly, flavour, state, first, second, delay):
    wrong, answers = played(fly, flavour, state, first, second, delay)
    assert wrong == [], answers
