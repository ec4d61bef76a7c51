"""Ground stations beside the edge: what they see of a vehicle, and what they may do with it."""

import asyncio
import contextlib
import inspect

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import Goal, GoTo, Refused, Vector3, Velocity
from fleet.link import memory
from fleet.link.memory import MemoryRobot
from fleet.link.url import OPENER, parse_link_url
from fleet_mavlink.signing import key_of
from fleet_mavlink.watcher import _MOST_STATIONS

both = pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
HOLD = {"ardupilot": "BRAKE", "px4": "LOITER"}
DESK = "udpout:10.0.0.5:14550"
WATCH = [{"link": DESK}]
OPERATE = [{"link": DESK, "may": "operate"}]
GUIDED, BRAKE, RTL = 4, 17, 6
KEY = "correct horse battery"


class Station:
    """A ground station behind a link of its own; ``received`` is what came, decoded by pymavlink."""

    def __init__(self, system=255, component=190, url=DESK):
        self.received, self.datagrams = [], []
        self._peer = MemoryRobot(url.rpartition(":")[0].replace(":", "-"), self._receive)
        self._parser = mav.MAVLink(None)
        self._parser.robust_parsing = True
        self.sender = mav.MAVLink(None, srcSystem=system, srcComponent=component)

    def __enter__(self):
        self._peer.__enter__()
        return self

    def __exit__(self, *_):
        self._peer.__exit__(None, None, None)

    def _receive(self, data):
        self.datagrams.append(data)
        self.received += self._parser.parse_buffer(bytearray(data)) or ()
        return b""

    def send(self, *messages):
        for message in messages:
            self._peer.say(bytes(message.pack(self.sender)))

    def of(self, kind):
        return [message for message in self.received if message.get_type() == kind]

    async def requests(self, command, *params):
        """Ask by COMMAND_LONG; return the result of the answer."""
        before = len(self.of("COMMAND_ACK"))
        self.send(long(command, *params))
        await self.wait_until(lambda: len(self.of("COMMAND_ACK")) > before)
        answer = self.of("COMMAND_ACK")[-1]
        assert answer.command == command
        assert answer.get_srcSystem() == 1
        return answer.result

    async def wait_until(self, holds, within=30.0):
        async with asyncio.timeout(within):
            while not holds():  # noqa: ASYNC110 - time jumps here
                await asyncio.sleep(0.02)


def long(command, *params, system=1):
    return mav.MAVLink_command_long_message(system, 1, command, 0, *(*params, *([0.0] * (7 - len(params)))))


async def opened(url, receiver):
    """Open links as they are, but those of stations in memory."""
    parts = parse_link_url(url)
    name = parts.path or url.rpartition(":")[0].replace(":", "-")
    return await memory.open_memory(url, name, receiver)


@contextlib.asynccontextmanager
async def watched(sim_flight, flavour="ardupilot", *, system=255, watchers=WATCH, **config):
    """Give a vehicle, and a station that is heard."""
    token = OPENER.set(opened)
    try:
        with Station(system) as station:
            async with sim_flight(flavour, watchers=watchers, **config) as it:
                await it.wait_until_known()
                station.send(mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
                yield it, station
    finally:
        OPENER.reset(token)


@both
def test_a_station_sees_what_the_vehicle_tells(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with watched(sim_flight, flavour) as (it, station):
            wanted = ("HEARTBEAT", "ATTITUDE", "GLOBAL_POSITION_INT", "SYS_STATUS", "GPS_RAW_INT", "VFR_HUD")
            await station.wait_until(lambda: all(station.of(kind) for kind in wanted))
            assert {message.get_srcSystem() for message in station.received} == {1}
            assert not any(message.type == 6 for message in station.of("HEARTBEAT"))  # ours is not shown
            assert max(map(len, station.datagrams)) <= 1400
            assert it.robot.is_connected

    run_in_sim_time(main())


@both
def test_a_station_reads_parameters_and_plans(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with watched(sim_flight, flavour) as (_, station):
            name = {"ardupilot": "RTL_ALT", "px4": "RTL_RETURN_ALT"}[flavour]
            station.send(mav.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
            await station.wait_until(lambda: any(each.param_id == name for each in station.of("PARAM_VALUE")))
            station.send(mav.MAVLink_mission_request_list_message(1, 1, 0))
            await station.wait_until(lambda: station.of("MISSION_COUNT"))
            answer = station.of("MISSION_COUNT")[-1]
            assert (answer.target_system, answer.target_component) == (255, 190)
            assert await station.requests(512, 148) == mav.MAV_RESULT_ACCEPTED
            await station.wait_until(lambda: station.of("AUTOPILOT_VERSION"))

    run_in_sim_time(main())


def test_answers_to_this_edge_are_not_shown(run_in_sim_time, sim_flight):
    async def main():
        async with watched(sim_flight) as (it, station):
            await it.do("takeoff", altitude=5.0)
            await asyncio.sleep(1)
            assert not station.of("COMMAND_ACK")

    run_in_sim_time(main())


def test_a_stations_heartbeat_does_not_reach_the_vehicle(run_in_sim_time, sim_flight):
    """It would keep the autopilot from noticing that this edge is lost."""

    async def main():
        async with watched(sim_flight) as (it, station):
            received = []
            it.sim.pilot.gcs_heartbeat = lambda message: received.append(message.get_srcSystem())
            for _ in range(5):
                station.send(mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
                await asyncio.sleep(1)
            assert set(received) == {245}

    run_in_sim_time(main())


@both
def test_who_only_watches_commands_nothing_and_that_is_logged(run_in_sim_time, sim_flight, flavour, caplog):
    async def main():
        async with watched(sim_flight, flavour) as (it, station):
            for _ in range(3):
                assert await station.requests(400, 1) == mav.MAV_RESULT_DENIED
            await station.wait_until(lambda: station.of("STATUSTEXT"))
            assert any("may: watch" in text.text for text in station.of("STATUSTEXT"))
            assert not it.armed
            assert not [each for each in it.requested(400) if each.param1 == 1]

    run_in_sim_time(main())
    lines = [line for line in caplog.messages if "COMMAND_LONG refused: may: watch" in line]
    assert lines == [f"ground station 255/190 at {DESK}: COMMAND_LONG refused: may: watch"]


def test_a_reason_is_reported_again_after_a_minute(run_in_sim_time, sim_flight, caplog):
    async def main():
        async with watched(sim_flight) as (_, station):
            for _ in range(3):
                await station.requests(400, 1)
            await asyncio.sleep(61)
            await station.requests(400, 1)

    run_in_sim_time(main())
    lines = [line for line in caplog.messages if "COMMAND_LONG refused" in line]
    assert len(lines) == 2
    assert lines[1].endswith("(2 more since)")


@both
def test_who_only_watches_writes_no_parameter_and_sees_its_value(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with watched(sim_flight, flavour) as (it, station):
            name = {"ardupilot": "RTL_ALT", "px4": "MIS_TAKEOFF_ALT"}[flavour]
            kept = it.sim._params[name]
            station.send(mav.MAVLink_param_set_message(1, 1, name.encode(), 1.5, 9))
            await station.wait_until(lambda: station.of("PARAM_ERROR"))
            await station.wait_until(lambda: any(each.param_id == name for each in station.of("PARAM_VALUE")))
            assert it.sim._params[name] == kept

    run_in_sim_time(main())


@both
def test_who_only_watches_uploads_and_clears_no_plan(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with watched(sim_flight, flavour) as (_, station):
            station.send(mav.MAVLink_mission_count_message(1, 1, 3, 0))
            await station.wait_until(lambda: len(station.of("MISSION_ACK")) == 1)
            station.send(mav.MAVLink_mission_clear_all_message(1, 1, 0))
            await station.wait_until(lambda: len(station.of("MISSION_ACK")) == 2)
            assert {answer.type for answer in station.of("MISSION_ACK")} == {mav.MAV_MISSION_DENIED}
            assert not station.of("MISSION_REQUEST") + station.of("MISSION_REQUEST_INT")

    run_in_sim_time(main())


@both
def test_a_stop_is_everybodys(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with watched(sim_flight, flavour) as (it, station):
            await it.do("takeoff", altitude=10.0)
            it.adapter.drive(Velocity(Vector3(3.0, 0.0, 0.0)))
            await it.until(lambda: it.speed > 2.0)
            mode = (1, BRAKE) if flavour == "ardupilot" else (1, 4, 3)
            assert await station.requests(176, *mode) == mav.MAV_RESULT_ACCEPTED
            await it.until(lambda: it.mode == HOLD[flavour] and it.speed < 0.3)
            assert it.robot.losses == ["ground station 255/190 commands it"]
            await asyncio.sleep(3)
            assert it.speed < 0.3

    run_in_sim_time(main())


@pytest.mark.parametrize("flies", ["what the station sent it to", "home"])
def test_a_pause_that_a_plane_does_not_take_stops_it_whoever_moves_it(run_in_sim_time, sim_flight, flies):
    async def main():
        limits = {"speed": 30.0, "distance": 5000.0}
        async with watched(sim_flight, vehicle="plane", watchers=OPERATE, limits=limits) as (it, station):
            await it.until(lambda: "TKOFF_ALT" in it.state.settings)
            await it.do("takeoff", altitude=40.0)
            if flies == "home":
                assert await station.requests(20) == mav.MAV_RESULT_ACCEPTED
            else:
                place = (int((it.state.position.latitude + 0.03) * 1e7), 85455940, 540.0)
                nothing = float("nan")
                station.send(mav.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, nothing, *place))
            await it.until(lambda: it.robot.losses)
            await asyncio.sleep(5.0)
            assert it.mode in {"GUIDED", "RTL"}
            station.send(long(193, 0.0))
            await it.until(lambda: it.mode == "LOITER", within=2.0)
            assert len(it.robot.losses) == 1

    run_in_sim_time(main())


@both
def test_an_operator_takes_the_vehicle_over_as_a_pilot_does(run_in_sim_time, sim_flight, flavour):
    async def main():
        async with watched(sim_flight, flavour, watchers=OPERATE) as (it, station):
            await it.do("takeoff", altitude=10.0)
            flight = asyncio.ensure_future(anext(it.adapter.navigate(GoTo(Goal(Vector3(80.0, 0.0, 10.0))))))
            await it.until(lambda: it.speed > 2.0)
            assert await station.requests(20) == mav.MAV_RESULT_ACCEPTED
            await it.until(lambda: it.mode == "RTL")
            assert it.robot.losses == ["ground station 255/190 commands it"]
            with pytest.raises(Refused, match="a pilot or a fail-safe has it"):
                await it.adapter.stop("stop")
            assert it.mode == "RTL"
            await it.adapter.stop("hover")
            assert it.mode == HOLD[flavour]
            flight.cancel()

    run_in_sim_time(main())


def test_setpoints_of_an_operator_in_our_own_mode_end_ours(run_in_sim_time, sim_flight):
    async def main():
        async with watched(sim_flight, watchers=OPERATE) as (it, station):
            await it.do("takeoff", altitude=10.0)
            it.adapter.drive(Velocity(Vector3(3.0, 0.0, 0.0)))
            await it.until(lambda: it.speed > 2.0)
            place = (0.0, 0.0, -10.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            station.send(mav.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0x0DF8, *place))
            await it.until(lambda: it.robot.losses)
            ours = len(it.setpoints)
            await asyncio.sleep(3)
            assert len(it.setpoints) == ours
            assert it.mode == "GUIDED"

    run_in_sim_time(main())


def test_an_operator_flies_alone(run_in_sim_time, sim_flight):
    async def main():
        async with watched(sim_flight, watchers=OPERATE) as (it, station):
            assert await station.requests(176, 1, GUIDED) == mav.MAV_RESULT_ACCEPTED
            await it.until(lambda: it.state.prearm_ok)
            assert await station.requests(400, 1) == mav.MAV_RESULT_ACCEPTED
            assert await station.requests(22, 0, 0, 0, 0, 0, 0, 6) == mav.MAV_RESULT_ACCEPTED
            await it.until(lambda: it.height > 5.5)
            station.send(mav.MAVLink_param_set_message(1, 1, b"WPNAV_SPEED", 300.0, 9))
            await station.wait_until(lambda: station.of("PARAM_VALUE"))
            assert it.sim._params["WPNAV_SPEED"] == 300.0
            station.send(mav.MAVLink_mission_count_message(1, 1, 2, 0))
            await station.wait_until(lambda: station.of("MISSION_REQUEST"))

    run_in_sim_time(main())


def test_only_the_station_that_is_named_operates(run_in_sim_time, sim_flight):
    async def main():
        async with watched(sim_flight, watchers=OPERATE, system=254) as (_, station):
            assert await station.requests(400, 1) == mav.MAV_RESULT_DENIED
            await station.wait_until(lambda: station.of("STATUSTEXT"))
            assert "station 255 operates" in "".join(text.text for text in station.of("STATUSTEXT"))

    run_in_sim_time(main())


def test_an_operator_only_brings_it_down_while_an_emergency_stop_is_set(run_in_sim_time, sim_flight):
    async def main():
        async with watched(sim_flight, watchers=OPERATE) as (it, station):
            await it.do("takeoff", altitude=6.0)
            it.robot.emergency_stop = True
            assert await station.requests(176, 1, GUIDED) == mav.MAV_RESULT_DENIED
            assert await station.requests(22, 0, 0, 0, 0, 0, 0, 9) == mav.MAV_RESULT_DENIED
            assert await station.requests(176, 1, BRAKE) == mav.MAV_RESULT_ACCEPTED
            assert await station.requests(176, 1, RTL) == mav.MAV_RESULT_ACCEPTED  # it may come down
            assert await station.requests(21) == mav.MAV_RESULT_ACCEPTED
            it.robot.emergency_stop = False
            assert await station.requests(176, 1, GUIDED) == mav.MAV_RESULT_ACCEPTED

    run_in_sim_time(main())


def test_rates_by_which_this_edge_flies_are_not_changed(run_in_sim_time, sim_flight):
    async def main():
        async with watched(sim_flight, watchers=OPERATE) as (_, station):
            station.send(mav.MAVLink_request_data_stream_message(1, 1, 0, 1, 1))
            assert await station.requests(511, 30, 1_000_000) == mav.MAV_RESULT_DENIED
            assert await station.requests(511, 32, 250_000) == mav.MAV_RESULT_ACCEPTED
            await station.wait_until(lambda: len(station.of("LOCAL_POSITION_NED")) > 3)
            before = len(station.of("ATTITUDE"))
            await asyncio.sleep(2)
            assert len(station.of("ATTITUDE")) - before > 15

    run_in_sim_time(main())


def test_a_station_with_the_ids_of_this_edge_or_of_a_vehicle_is_not_obeyed(
    run_in_sim_time, sim_flight, caplog
):
    async def main():
        async with watched(sim_flight, watchers=OPERATE) as (it, station):
            for system, component in ((245, 191), (1, 190)):
                station.sender.srcSystem, station.sender.srcComponent = system, component
                station.send(long(400, 1))
            await asyncio.sleep(1)
            assert not it.armed

    run_in_sim_time(main())
    assert "it has the ids of this edge" in caplog.text
    assert "that of a vehicle, is ignored" in caplog.text


def test_what_is_for_all_or_for_an_unknown_vehicle_reaches_none(run_in_sim_time, sim_flight, caplog):
    async def main():
        async with watched(sim_flight, watchers=OPERATE) as (it, station):
            await it.until(lambda: it.state.prearm_ok)
            station.send(long(400, 1, system=0), long(400, 1, system=9))
            await asyncio.sleep(1)
            assert not it.armed

    run_in_sim_time(main())
    assert "no vehicle 9 is shown here" in caplog.text


def test_garbage_and_a_flood_do_no_harm(run_in_sim_time, sim_flight, caplog):
    async def main():
        async with watched(sim_flight) as (it, station):
            station._peer.say(b"\xfd\xff" * 500 + bytes(range(256)) * 20)
            for _ in range(1000):
                station.send(mav.MAVLink_param_request_read_message(1, 1, b"RTL_ALT", -1))
            for system in range(2, 200):
                station.sender.srcSystem = system
                station.send(mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
                await asyncio.sleep(0.02)
            await it.do("takeoff", altitude=5.0)
            (watcher,) = _watchers(it)
            assert len(watcher.stations) <= _MOST_STATIONS

    run_in_sim_time(main())
    assert "more than 100 messages a second" in caplog.text


def _watchers(it):
    give = it.adapter._hub._taps[1]
    shown = inspect.getclosurevars(give).nonlocals["shown"]
    return {each._watcher for each in shown}


def test_the_vehicle_flies_while_the_stations_link_is_down(run_in_sim_time, sim_flight):
    async def main():
        token = OPENER.set(opened)
        try:
            async with sim_flight("px4", watchers=WATCH) as it:  # nobody is at the address
                await it.wait_until_known()
                await it.do("takeoff", altitude=5.0)
                assert it.height == pytest.approx(5.0, abs=0.9)
        finally:
            OPENER.reset(token)

    run_in_sim_time(main())


def is_signed(message):
    return bool(message.get_msgbuf()[2] & 1)


def signs(station, key, now):
    station.sender.signing.secret_key = key_of(key)
    station.sender.signing.sign_outgoing = True
    station.sender.signing.timestamp = int((now - 1_420_070_400) * 1e5)


@pytest.mark.parametrize("key", [None, "another passphrase", KEY])
def test_what_reaches_a_vehicle_that_signs_is_signed_with_its_key(run_in_sim_time, sim_flight, key):
    async def main():
        config = {"signing_key": KEY, "accept_unsigned": True, "watchers": OPERATE}
        async with watched(sim_flight, **config) as (it, station):
            await it.do("setup_signing")
            await station.wait_until(lambda: is_signed(station.received[-1]))
            if key is not None:
                signs(station, key, it.robot.clock.time())
            right = key == KEY
            wanted = mav.MAV_RESULT_ACCEPTED if right else mav.MAV_RESULT_DENIED
            assert await station.requests(176, 1, GUIDED) == wanted
            assert is_signed(station.of("COMMAND_ACK")[-1])
            assert (it.mode == "GUIDED") is right

    run_in_sim_time(main())
