"""A stop brakes whatever speaks MAVLink, whoever moves it, and is seen to, or fails aloud."""

import asyncio
import itertools
import math

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import GeoPoint, NotReady, Refused, TimedOut, Unsupported, Vector3, Velocity
from fleet.model.health import Level
from fleet.model.report import (
    BatteryReport,
    FlightControllerReport,
    FlightStateReport,
    GpsReport,
    LogReport,
    PoseReport,
    TelemetryReport,
)
from fleet_mavlink.braking import Brakes
from fleet_mavlink.command_queue import Superseded
from fleet_mavlink.commander import Commander, CommandTimeouts
from fleet_mavlink.constants import MavCmd, MavResult, type_name
from fleet_mavlink.flavours import kind_of
from fleet_mavlink.messages import CommandAck, ExtendedSysState, GlobalPositionInt, Heartbeat
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import missing_commands
from fleet_mavlink.vocabulary import OF_A_MOVED_VEHICLE

HOLD, GUIDED = 4, 15
SUBMARINE = 12
ARDUPILOT, PX4, OTHER = 3, 12, 17
LOITER_PX4 = 0x03040000
NAN = math.nan


async def other_station_drives(it, speed=5.0):
    """Have another station arm the rover and drive it, as a person at another console would."""
    await it.wait_until_known()
    it.send_from_station(mav.MAVLink_command_long_message(1, 1, 176, 0, 1, GUIDED, 0, 0, 0, 0, 0))
    it.send_from_station(mav.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))

    async def stream():
        while True:
            zeros = (0.0, 0.0, 0.0)
            it.send_from_station(
                mav.MAVLink_set_position_target_local_ned_message(
                    0, 1, 1, 8, 0x0DC7, *zeros, speed, 0.0, 0.0, *zeros, 0.0, 0.0
                )
            )
            await asyncio.sleep(0.2)

    driving = asyncio.ensure_future(stream())
    await it.until(lambda: it.speed > speed)
    return driving


@pytest.mark.parametrize("reason", ["stop", "emergency_stop", "hover", "brake", "pause"])
def test_a_rover_that_another_station_drives_is_braked_by_every_stop(run_in_sim_time, sim_flight, reason):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            driving = await other_station_drives(it)
            began = it.now
            await it.adapter.stop(reason)
            assert it.now - began < 4.8, "before the host gives it up"
            assert it.mode == "HOLD"
            assert it.speed < 3.6
            await it.until(lambda: it.speed < 0.2, within=10.0)
            driving.cancel()

    run_in_sim_time(main())


def test_a_halt_is_written_to_it_at_once(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            driving = await other_station_drives(it)
            it.adapter.emergency_halt()
            assert it.mode == "HOLD"
            driving.cancel()

    run_in_sim_time(main())


def test_the_end_of_an_edge_leaves_what_is_not_moved_here_to_who_moves_it(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            it.sim.pilot.vehicle_type = SUBMARINE
            driving = await other_station_drives(it)
            await it.adapter.stop("the edge ends")
            assert it.mode == "GUIDED"
            driving.cancel()

    run_in_sim_time(main())


def test_a_rover_that_rolls_on_in_hold_is_not_called_stopped(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            driving = await other_station_drives(it)

            async def downhill():
                while True:
                    it.sim.body.along = 5.0
                    await asyncio.sleep(0.02)

            rolling = asyncio.ensure_future(downhill())
            still = r"ground_rover on ardupilot took HOLD and still moves at 4\.9"  # braked for a step
            with pytest.raises(TimedOut, match=still):
                await it.adapter.stop("stop")
            await it.until(lambda: "was not stopped" in it.robot.healths[-1].cause, within=1.0)
            rolling.cancel()
            await it.adapter.stop("stop")
            await it.until(lambda: "was not stopped" not in it.robot.healths[-1].cause, within=1.0)
            driving.cancel()

    run_in_sim_time(main())


def test_a_rover_that_takes_no_mode_is_disarmed(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            driving = await other_station_drives(it)
            it.sim.pilot.refusal_of = lambda mode: "not today" if mode.name == "HOLD" else ""
            await it.adapter.stop("emergency_stop")
            assert not it.armed
            await it.until(lambda: it.speed < 0.2, within=10.0)
            driving.cancel()

    run_in_sim_time(main())


def test_a_stop_on_the_heels_of_another_does_not_disarm_it(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover", faults={"delay": 0.2}) as it:
            driving = await other_station_drives(it)
            first = asyncio.ensure_future(it.adapter.stop("stop"))
            await asyncio.sleep(0.05)
            await it.adapter.stop("emergency_stop")
            with pytest.raises(Superseded):
                await first
            assert it.mode == "HOLD"
            assert it.armed
            driving.cancel()

    run_in_sim_time(main())


def test_what_is_not_heard_is_not_called_stopped(run_in_sim_time, sim_flight):
    async def main():
        for vehicle in ("multirotor", "rover"):
            async with sim_flight("ardupilot", vehicle=vehicle) as it:
                await it.wait_until_known()
                it.radio = False
                await asyncio.sleep(3.2)
                for reason in ("stop", "emergency_stop"):
                    with pytest.raises(NotReady, match="no heartbeat"):
                        await it.adapter.stop(reason)

    run_in_sim_time(main())


def test_a_rover_is_reported_with_its_type_and_without_a_height(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            driving = await other_station_drives(it)
            it.robot.reports.clear()
            await asyncio.sleep(6.0)
            types = {type(report) for report in it.robot.reports}
            assert {PoseReport, GpsReport, BatteryReport, FlightControllerReport} <= types
            assert FlightStateReport not in types
            controller = next(each for each in it.robot.reports if isinstance(each, FlightControllerReport))
            assert (controller.vehicle, controller.mode) == ("ground_rover", "GUIDED")
            assert controller.armed
            state = [each for each in it.robot.reports if isinstance(each, TelemetryReport)][-1].fields
            assert state["vehicle"] == "ground_rover"
            assert "altitude_m" not in state
            poses = [each for each in it.robot.reports if isinstance(each, PoseReport)]
            assert abs(poses[-1].position.z) < 1.0
            assert poses[-1].position.y > poses[0].position.y + 10.0
            assert it.robot.healths[-1].level is Level.OK
            driving.cancel()
            await it.until(
                lambda: any("target not" in said.message for said in it.robot.reports_of(LogReport))
            )

    run_in_sim_time(main())


def test_what_is_not_moved_here_is_not_moved_not_even_by_one_setpoint(run_in_sim_time, sim_flight):
    async def main():
        async with sim_flight("ardupilot", vehicle="rover") as it:
            it.sim.pilot.vehicle_type = SUBMARINE
            driving = await other_station_drives(it)
            driving.cancel()
            health = it.robot.healths[-1]
            assert health.level is Level.DEGRADED
            assert "submarine on ardupilot" in health.cause
            with pytest.raises(Unsupported, match="not moved here"):
                it.adapter.drive(Velocity(Vector3(1.0, 0.0, 0.0)))
            for command in ("takeoff", "land", "return_to_home"):
                with pytest.raises(Unsupported, match="submarine"):
                    await it.do(command)
            assert it.setpoints == []
            assert set(it.robot.lacking) == set(OF_A_MOVED_VEHICLE)

    run_in_sim_time(main())


@pytest.mark.parametrize("vehicle_type", [10, 11])
def test_a_rover_on_px4_is_refused_with_what_is_missing_and_what_is_moved(vehicle_type):
    lacking = missing_commands(VehicleState(Heartbeat(vehicle_type, 12)))
    assert set(lacking) == set(OF_A_MOVED_VEHICLE)
    assert all("holding and stopping of PX4 rovers was never measured" in why for why in lacking.values())
    assert "PX4 rovers" not in missing_commands(VehicleState(Heartbeat(SUBMARINE, 12)))["goto"]


def first_brake(autopilot, vehicle_type, **state):
    """Return the mode that brakes a vehicle, best first."""
    vehicle_state = VehicleState(**state)
    return [
        brake.mode
        for brake in kind_of(Heartbeat(vehicle_type, autopilot), vehicle_state).brakes(vehicle_state)
    ]


@pytest.mark.parametrize(
    ("vehicle_type", "modes"),
    [
        (1, ["GUIDED", "LOITER", "CIRCLE"]),
        (2, ["BRAKE"]),
        (5, ["STOP"]),
        (7, ["LOITER", "LAND"]),
        (10, ["HOLD"]),
        (11, ["LOITER", "HOLD"]),
        (12, ["POSHOLD", "ALT_HOLD"]),
        (20, ["GUIDED", "LOITER", "CIRCLE"]),
        (22, ["GUIDED", "LOITER", "CIRCLE"]),
    ],
)
def test_each_vehicle_on_ardupilot_has_its_brakes(vehicle_type, modes):
    assert first_brake(ARDUPILOT, vehicle_type) == modes


@pytest.mark.parametrize("vehicle_type", [1, 22])
def test_a_hovering_quadplane_is_neither_sent_forward_nor_left_to_a_stick_that_is_not_there(vehicle_type):
    hovers = {"vtol_state": 3, "position": GeoPoint(47.0, 8.0, 500.0)}
    set_up = {"settings": {"Q_GUIDED_MODE": 1.0}}
    assert first_brake(ARDUPILOT, vehicle_type, **hovers, **set_up) == ["GUIDED", "QLAND"]
    assert first_brake(ARDUPILOT, vehicle_type, vtol_state=3, **set_up) == ["QLAND"]
    assert first_brake(ARDUPILOT, vehicle_type, **hovers) == ["QLAND"]


def test_what_is_said_to_be_on_its_wings_circles():
    for vtol_state in (0, 4):
        assert first_brake(ARDUPILOT, 1, vtol_state=vtol_state) == ["LOITER", "CIRCLE"]


def test_a_hovering_quadplane_is_sent_to_where_it_comes_to_stand():
    state = VehicleState(
        vtol_state=3,
        settings={"Q_GUIDED_MODE": 1.0},
        position=GeoPoint(47.0, 8.0, 500.0),
        velocity=Vector3(4.0, 0.0, 0.0),
    )
    request = kind_of(Heartbeat(1, ARDUPILOT), state).brakes(state)[0].request
    assert (request.command, request.frame, request.z) == (MavCmd.DO_REPOSITION, 5, 500.0)
    assert (request.x - 470_000_000) * 0.0111 == pytest.approx(4.0, abs=0.1), "4 m/s at 2 m/s2"


@pytest.mark.parametrize(
    ("speed", "settings", "metres"),
    [
        (26.0, {}, 135.2),
        (26.0, {"Q_TRANS_DECEL": 2.0, "AIRSPEED_CRUISE": 25.0}, 135.2),
        (26.0, {"Q_TRANS_DECEL": 4.0, "AIRSPEED_CRUISE": 25.0}, 67.6),
        (35.0, {"Q_TRANS_DECEL": 2.0, "AIRSPEED_CRUISE": 25.0}, 210.9),
        (900.0, {}, 303.8),
    ],
)
def test_a_quadplane_from_its_wings_is_sent_as_far_as_it_needs_and_not_so_far_that_it_flies_there_on_them(
    speed, settings, metres
):
    state = VehicleState(
        vtol_state=2,
        settings={"Q_GUIDED_MODE": 1.0, **settings},
        position=GeoPoint(47.0, 8.0, 500.0),
        velocity=Vector3(speed, 0.0, 0.0),
    )
    request = kind_of(Heartbeat(1, ARDUPILOT), state).brakes(state)[0].request
    assert (request.x - 470_000_000) * 0.01112 == pytest.approx(metres, rel=0.01)


def test_a_quadplane_may_take_longer_to_slow_down_from_its_wings_than_in_its_hover():
    quadplane = kind_of(Heartbeat(1, ARDUPILOT), VehicleState(vtol_state=2, settings={"Q_GUIDED_MODE": 1.0}))
    assert quadplane.slows_to(26.0) > 21.6, "ArduPlane 4.6.3 was seen at 21.6 m/s 3 s later"
    assert quadplane.slows_to(5.0) == pytest.approx(3.5)


def test_every_vehicle_on_px4_is_held_at_its_place():
    for vehicle_type in range(46):
        assert first_brake(PX4, vehicle_type) == ["AUTO.LOITER"]


def test_everything_has_a_name_and_a_command_that_brakes_it():
    for autopilot, vehicle_type in itertools.product(range(21), range(46)):
        kind = kind_of(Heartbeat(vehicle_type, autopilot))
        assert kind.brakes(VehicleState())
        assert all(brake.request.command for brake in kind.brakes(VehicleState()))
        assert kind.name
        assert type_name(vehicle_type)


class Bench:
    """Any vehicle, armed and moving; ``answers`` says what it makes of each command."""

    def __init__(self, harness, autopilot, vehicle_type, *, mode=0, vtol_state=0):
        self.it = harness("ardupilot")
        self.autopilot, self.type, self.mode = autopilot, vehicle_type, mode
        self.speed = 12.0
        self.refuses = set()
        self.slows = True
        vehicle = self.it.vehicle
        vehicle._send = self._sent
        timing = CommandTimeouts(answer=0.05, tries=2, patience=0.0, pause=0.0, words=0.0, heartbeat=0.1)
        self.brakes = Brakes(vehicle, Commander(vehicle, timing))
        self.requested = []
        self.beat()
        self.beat()
        if vtol_state:
            self.it.receive(ExtendedSysState(0, vtol_state))
        self.moves()

    def beat(self):
        self.it.vehicle.handle_message(Heartbeat(self.type, self.autopilot, 0x81, self.mode, 4), None)

    def moves(self):
        place = (0, 470_000_000, 80_000_000, 500_000, 50_000)
        self.it.receive(GlobalPositionInt(*place, round(self.speed * 100), 0, 0, 0))

    def _sent(self, message, _address):
        self.requested.append(message)
        result = MavResult.FAILED if message.command in self.refuses else MavResult.ACCEPTED
        asyncio.get_running_loop().call_soon(self._answer, message, result)

    def _answer(self, message, result):
        self.it.clock.advance(0.2)
        self.it.receive(CommandAck(message.command, int(result)))
        if result == MavResult.ACCEPTED and message.command == MavCmd.DO_SET_MODE:
            self.mode = int(message.param2)
        elif result == MavResult.ACCEPTED and message.command == MavCmd.DO_REPOSITION:
            self.mode = LOITER_PX4
        self.beat()
        if self.slows and result == MavResult.ACCEPTED:
            self.speed = 0.0
        self.moves()


async def test_a_px4_plane_that_circles_has_done_what_it_can(harness):
    it = Bench(harness, PX4, 1)
    it.slows = False
    await it.brakes.brake()
    assert [each.command for each in it.requested] == [MavCmd.DO_REPOSITION]
    assert math.isnan(it.requested[0].param5)


async def test_a_px4_vtol_that_hovers_must_stand(harness, monkeypatch):
    monkeypatch.setattr("fleet_mavlink.braking._WITHIN", 0.05)
    monkeypatch.setattr("fleet_mavlink.braking._AT_LEAST", 0.05)
    it = Bench(harness, PX4, 22, vtol_state=3)
    it.slows = False
    with pytest.raises(TimedOut, match="still moves at 12"):
        await it.brakes.brake()


async def test_a_sub_without_a_place_keeps_its_depth(harness):
    it = Bench(harness, ARDUPILOT, 12)
    modes = []
    answer = it._answer

    def without_a_place(message, result):
        modes.append(int(message.param2))
        answer(message, MavResult.FAILED if message.param2 == 16 else result)

    it._answer = without_a_place
    await it.brakes.brake()
    assert modes == [16, 2]


async def test_an_unknown_autopilot_is_asked_to_pause_and_must_stand(harness):
    it = Bench(harness, OTHER, 10)
    await it.brakes.brake()
    assert [each.command for each in it.requested] == [MavCmd.DO_PAUSE_CONTINUE]


async def test_an_unknown_autopilot_that_refuses_is_reported(harness):
    it = Bench(harness, OTHER, 10)
    it.refuses.add(MavCmd.DO_PAUSE_CONTINUE)
    with pytest.raises(Refused, match="was not stopped"):
        await it.brakes.brake()


async def test_a_plane_that_takes_no_mode_is_reported_and_never_disarmed(harness):
    it = Bench(harness, ARDUPILOT, 1)
    it.refuses.add(MavCmd.DO_SET_MODE)
    with pytest.raises(Refused, match="fixed_wing on ardupilot was not stopped"):
        await it.brakes.brake()
    assert {each.command for each in it.requested} == {MavCmd.DO_SET_MODE}
