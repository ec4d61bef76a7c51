"""The flight list on real autopilots: ``FLEET_SITL=udpin:0.0.0.0:14550,tcp:127.0.0.1:5760 pytest -m sitl``.

Not run by default: the marker leaves it out. An address may end with ``#5`` for the system id 5. A report is
written beside where it is run, one file for each address, to attach to an issue.
"""

import contextlib
import os
from pathlib import Path

import pytest

FAST = 30.0  # m/s, of what has wings
ADDRESSES = [each for each in os.environ.get("FLEET_SITL", "").split(",") if each]


@pytest.mark.sitl
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("address", ADDRESSES or [None])
async def test_an_autopilot_flies_the_list(sitl, module_at, address):
    assert address, "say where the autopilot is: FLEET_SITL=udpin:0.0.0.0:14550"
    link, _, system = address.partition("#")
    lines = []

    def note(line):
        lines.append(line)
        written(address, lines)  # at once: a flight is long

    note(f"flight list on {address}")
    async with sitl(link, int(system or 1)) as it:
        await it.until(lambda: it.robot.is_connected and it.state.heartbeat, 60.0)
        flavour = it.adapter._session.vehicle.flavour
        if flavour is None:
            return  # not moved here
        if flavour.surface:
            other = module_at("sitl/other_station.py").OtherStation(it)
            await module_at("sitl/drive_list.py").drive(it, other, note)
        elif not flavour.settings:
            await module_at("sitl/flight_list.py").fly(it, note)
    if flavour.settings:
        async with sitl(link, int(system or 1), FAST) as it:
            planes = module_at("sitl/plane_list.py")
            await it.until(lambda: it.robot.is_connected and it.state.home is not None, 240.0)
            if it.adapter._session.vehicle.flavour.transitions:
                await module_at("sitl/vtol_list.py").fly(it, planes, note)
            else:
                await planes.fly(it, note)


def written(address, lines):
    """Write the report of one address."""
    Path(f"sitl-report-{ADDRESSES.index(address) + 1}.txt").write_text("\n".join(lines) + "\n")


@pytest.mark.sitl
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("address", ADDRESSES or [None])
async def test_a_ground_station_pauses_a_vehicle_whoever_moves_it(sitl, module_at, address):
    assert address, "say where the autopilot is: FLEET_SITL=udpin:0.0.0.0:14550"
    link, _, system = address.partition("#")
    pauses = module_at("sitl/pause_list.py")
    with contextlib.closing(pauses.Station()) as station:
        async with sitl(link, int(system or 1), FAST, watchers=[station.watcher]) as it:
            for step in pauses.STEPS:
                await step(it, station)


@pytest.mark.sitl
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("loss", ["satellites", "battery"])
@pytest.mark.parametrize("address", ADDRESSES or [None])
async def test_a_loss_is_reported_with_its_reason(sitl, module_at, address, loss):
    assert address, "say where the autopilot is: FLEET_SITL=udpin:0.0.0.0:14550"
    link, _, system = address.partition("#")
    async with sitl(link, int(system or 1)) as it:
        await it.until(lambda: it.robot.is_connected and it.state.heartbeat, 60.0)
        flavour = it.adapter._session.vehicle.flavour
        if flavour is None or flavour.surface or flavour.settings:
            return  # the losses are those of a multirotor in the air
        for step in module_at("sitl/loss_list.py").LISTS[loss]:
            await step(it)


@pytest.mark.sitl
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("address", ADDRESSES or [None])
async def test_a_vehicle_that_another_station_moves_is_stopped(sitl, module_at, address):
    assert address, "say where the autopilot is: FLEET_SITL=udpin:0.0.0.0:14550"
    link, _, system = address.partition("#")
    async with sitl(link, int(system or 1)) as it:
        await it.until(lambda: it.robot.is_connected and it.state.heartbeat, 60.0)
        other = module_at("sitl/other_station.py").OtherStation(it)
        for step in module_at("sitl/stop_list.py").steps_for(it):
            await step(it, other)
