"""The vocabulary for each type of vehicle: what is there works or says why not, what is not is refused."""

import asyncio
import contextlib
import itertools

import pytest

from fleet import FlyMission, GeoPoint, Goal, GoTo, PlanItem, Unsupported, Vector3, Velocity
from fleet.errors import CommandError
from fleet.wire.verbs import VERBS as HOSTS_VERBS
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.constants import ARDUPILOT, PX4
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import missing_commands
from fleet_mavlink.vocabulary import VERBS

SUBMARINE, BOAT = 12, 11
VEHICLES = {
    "multirotor on ArduPilot": ("ardupilot", "multirotor", None),
    "multirotor on PX4": ("px4", "multirotor", None),
    "rover": ("ardupilot", "rover", None),
    "boat": ("ardupilot", "rover", BOAT),
    "plane on ArduPilot": ("ardupilot", "plane", None),
    "plane on PX4": ("px4", "plane", None),
    "VTOL on PX4": ("px4", "vtol", None),
    "QuadPlane as delivered": ("ardupilot", "vtol", None),
    "not moved": ("ardupilot", "rover", SUBMARINE),
}
DATA = {
    "ascend": {"distance": 1.0},
    "descend": {"distance": 1.0},
    "set_home_location": {"latitude": 47.397742, "longitude": 8.545594},
    "get_parameters": {"names": ["SYSID_THISMAV"]},
    "set_parameter": {"name": "NO_SUCH_ONE", "value": 1.0},
    "read_log": {"id": 1},
    "gimbal_rotate": {"pitch": -10.0},
    "gimbal_rotate_speed": {"pitch": 10.0},
    "set_gimbal_pitch": {"pitch": -10.0},
    "transition": {"to": "forward"},
}
DIRECTIONS = {
    "move_forward": Velocity(Vector3(1.0, 0.0, 0.0)),
    "move_backward": Velocity(Vector3(-1.0, 0.0, 0.0)),
    "strafe_left": Velocity(Vector3(0.0, 1.0, 0.0)),
    "strafe_right": Velocity(Vector3(0.0, -1.0, 0.0)),
    "turn_left": Velocity(Vector3(), 0.5),
    "turn_right": Velocity(Vector3(), -0.5),
}
TASKS = {
    "goto": GoTo(Goal(position=Vector3(3.0, 3.0, 5.0))),
    "plan": FlyMission("m", (PlanItem("waypoint", GeoPoint(47.3978, 8.5456, 5.0)),)),
}
COMMANDS = sorted(MavlinkAdapter.commands())
NAMES = (*DIRECTIONS, *TASKS, *COMMANDS)
MOVING = {
    "cancel_takeoff",
    "cancel_landing",
    "cancel_return_to_home",
}  # one method: it is told apart by the host


def test_the_verbs_are_those_of_the_host():
    assert list(HOSTS_VERBS) == list(VERBS)
    assert set(DATA) <= set(COMMANDS)


async def tried(it, name):
    """Do what a name says, for a moment; return why it was refused, empty when it was taken."""
    try:
        async with asyncio.timeout(6.0):
            if name in DIRECTIONS:
                await it.drive(DIRECTIONS[name], 0.3)
            elif name in TASKS:
                await anext(it.adapter.navigate(TASKS[name]))
            else:
                await it.do(name, **DATA.get(name, {}))
    except CommandError as error:
        return error.reason if isinstance(error, Unsupported) else ""
    except TimeoutError:
        return ""  # it is under way
    return ""


@pytest.fixture
def met(sim_flight):
    """Meet a vehicle on the ground, until it is known what it lacks."""

    @contextlib.asynccontextmanager
    async def meet(vehicle):
        flavour, kind, vehicle_type = VEHICLES[vehicle]
        async with sim_flight(flavour, vehicle=kind) as it:
            if vehicle_type is not None:
                it.sim.pilot.vehicle_type = vehicle_type
            await it.until(lambda: it.robot.is_connected and it.state.home is not None)
            await it.until(lambda: it.state.vtol_state == it.sim.pilot.vtol_state())
            await it.until(lambda: it.robot.lacking == missing_commands(it.state))
            yield it

    return meet


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_each_name_that_a_vehicle_lacks_is_refused_with_the_words_of_the_table(run_in_sim_time, met, vehicle):
    async def main():
        async with met(vehicle) as it:
            lacking = missing_commands(it.state)
            for name in NAMES:
                if name in lacking and name not in MOVING:
                    it.order.clear()
                    assert await tried(it, name) == lacking[name], name
                    assert 400 not in it.order, f"{name}: it was armed"
                    assert not {22, 21, 20, 192} & set(it.order), f"{name}: what moves it was sent"
                    assert it.setpoints == [], name

    run_in_sim_time(main())


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_each_name_that_a_vehicle_has_is_taken(run_in_sim_time, met, vehicle):
    async def main():
        async with met(vehicle) as it:
            lacking = missing_commands(it.state)
        for name in NAMES:
            if name not in lacking:
                async with met(vehicle) as it:
                    assert "not moved" not in await tried(it, name), name

    run_in_sim_time(main())


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4, 17])
def test_every_vehicle_has_a_reason_for_each_name_that_it_lacks(autopilot):
    known = {*VERBS, "goto", "plan", *COMMANDS}
    for vehicle_type in range(46):
        for vtol_state, guided in itertools.product(range(5), (0.0, 1.0)):
            heartbeat, settings = Heartbeat(vehicle_type, autopilot), {"Q_GUIDED_MODE": guided}
            lacking = missing_commands(VehicleState(heartbeat, vtol_state=vtol_state, settings=settings))
            assert set(lacking) <= known
            assert all(lacking.values())
            assert not {"stop", "hover", "emergency_stop"} & set(lacking)
