"""The list that real autopilots are flown through, flown by the simulated ones."""

import pytest


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_the_simulated_autopilots_fly_the_list(fly, sky, module_at, flavour):
    lines = []

    async def main():
        async with sky(flavour) as it:
            await module_at("sitl/flight_list.py").fly(it, lines.append)

    fly(main())
    assert all(line.startswith("ok") for line in lines)
    assert len(lines) == len(module_at("sitl/flight_list.py").STEPS)
