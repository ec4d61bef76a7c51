"""The list that real autopilots are flown through, flown by the simulated ones."""

import pytest


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_the_simulated_autopilots_fly_the_list(run_in_sim_time, sim_flight, module_at, flavour):
    lines = []

    async def main():
        async with sim_flight(flavour) as it:
            await module_at("sitl/flight_list.py").fly(it, lines.append)

    run_in_sim_time(main())
    assert all(line.startswith("ok") for line in lines)
    assert len(lines) == len(module_at("sitl/flight_list.py").STEPS)


@pytest.mark.parametrize("loss", ["satellites", "battery"])
@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_the_simulated_autopilots_tell_their_losses(run_in_sim_time, sim_flight, module_at, flavour, loss):
    async def main():
        async with sim_flight(flavour) as it:
            for step in module_at("sitl/loss_list.py").LISTS[loss]:
                await step(it)

    run_in_sim_time(main())


def test_the_simulated_rover_drives_the_list(run_in_sim_time, sim_flight, module_at):
    lines = []

    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            other = module_at("sitl/other_station.py").OtherStation(it)
            await module_at("sitl/drive_list.py").drive(it, other, lines.append)

    run_in_sim_time(main())
    assert all(line.startswith("ok") for line in lines)
    assert len(lines) == len(module_at("sitl/drive_list.py").STEPS)
