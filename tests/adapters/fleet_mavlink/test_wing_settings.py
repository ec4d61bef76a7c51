"""The parameters that a winged aircraft needs for moving: read one by one until all are known."""

import asyncio
import contextlib
import struct

import pytest

from fleet import Refused
from fleet_mavlink.messages import ExtendedSysState, SystemTime
from fleet_mavlink.transfer_messages import ParamValue
from fleet_mavlink.wing_settings import WingSettings

PLANE, VTOL, COPTER = 1, 22, 2
NEEDED = {  # of ArduPlane, with any rotors that it may have
    "WP_LOITER_RAD": 60.0,
    "AIRSPEED_MIN": 10.0,
    "AIRSPEED_CRUISE": 15.0,
    "AIRSPEED_MAX": 22.0,
    "TKOFF_ALT": 50.0,
    "Q_GUIDED_MODE": 0.0,
    "Q_WP_SPEED": 5.0,
    "Q_TRANS_DECEL": 2.0,
    "Q_ASSIST_SPEED": 0.0,
}


class Vehicle:
    """Parameters of a vehicle, which answers those that it has, and the names it was asked for."""

    def __init__(self, it, has):
        self.it, self.has, self.asked = it, dict(has), []

    async def read(self, names):
        (name,) = names
        self.asked.append((name, self.it.vehicle.now()))
        if name not in self.has:
            raise Refused(f"system 1 has no parameter {name}")
        (bits,) = struct.unpack("<I", struct.pack("<f", self.has[name]))
        self.it.receive(ParamValue(name, bits, 9, 1, 0))

    @property
    def names(self):
        return {name for name, _ in self.asked}


@pytest.fixture
def read(run_in_sim_time, harness):
    """Run a test beside the settings of a vehicle that beats every second."""

    def read(test, kind, has, *, vtol_state=None):
        async def main():
            it = harness("ardupilot").in_loop()
            tasks = [asyncio.ensure_future(beats(it, kind, vtol_state))]
            parameters = Vehicle(it, has)
            tasks.append(asyncio.ensure_future(WingSettings(it.vehicle, parameters).run()))
            await test(it, parameters)
            for task in tasks:
                task.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await task

        run_in_sim_time(main())

    return read


async def beats(it, kind, vtol_state):
    while True:
        it.beat(kind=kind)
        if vtol_state is not None:
            it.receive(ExtendedSysState(1, vtol_state))
        await asyncio.sleep(1.0)


def test_what_it_needs_is_read_once_and_kept(read):
    async def test(it, parameters):
        await asyncio.sleep(60.0)
        wanted = set(it.vehicle.flavour.settings)
        assert {name: it.vehicle.state.settings[name] for name in wanted} == {
            name: NEEDED[name] for name in wanted
        }
        assert sorted(name for name, _ in parameters.asked) == sorted(wanted)

    read(test, PLANE, NEEDED, vtol_state=0)


def test_a_vehicle_without_wings_is_asked_for_nothing(read):
    async def test(it, parameters):
        await asyncio.sleep(60.0)
        assert parameters.asked == []

    read(test, COPTER, NEEDED)


def test_only_what_is_missing_is_asked_for_again_ten_seconds_later(read):
    async def test(it, parameters):
        await asyncio.sleep(5.0)
        parameters.has["AIRSPEED_MAX"] = 22.0
        before = len(parameters.asked)
        await asyncio.sleep(60.0)
        again = [name for name, _ in parameters.asked[before:]]
        assert again.count("AIRSPEED_MAX") == 1
        assert set(again) == {"AIRSPEED_MAX"}
        first, second = (at for name, at in parameters.asked if name == "AIRSPEED_MAX")
        assert second - first == pytest.approx(10.0, abs=0.1)
        assert it.vehicle.state.settings["AIRSPEED_MAX"] == 22.0

    has = {name: value for name, value in NEEDED.items() if name != "AIRSPEED_MAX"}
    read(test, PLANE, has, vtol_state=0)


def test_a_plane_without_rotors_is_not_asked_again_for_what_only_rotors_need(read):
    async def test(it, parameters):
        await asyncio.sleep(100.0)
        for name in parameters.names:
            assert len([each for each, _ in parameters.asked if each == name]) == 1

    has = {name: value for name, value in NEEDED.items() if not name.startswith("Q_")}
    read(test, PLANE, has, vtol_state=0)


def test_after_a_reboot_everything_is_read_again(read):
    async def test(it, parameters):
        await asyncio.sleep(20.0)
        it.receive(SystemTime(60_000))
        before = len(parameters.asked)
        parameters.has["AIRSPEED_CRUISE"] = 17.0
        it.receive(SystemTime(500))
        assert it.vehicle.state.settings == {}
        await asyncio.sleep(5.0)
        assert len(parameters.asked) == 2 * before
        assert it.vehicle.state.settings["AIRSPEED_CRUISE"] == 17.0

    read(test, PLANE, NEEDED, vtol_state=0)


def test_a_vehicle_that_turns_out_to_have_rotors_is_asked_for_what_they_need(read):
    async def test(it, parameters):
        await asyncio.sleep(5.0)
        before = parameters.names
        it.receive(ExtendedSysState(1, 3))
        await asyncio.sleep(0.5)
        assert parameters.names >= set(it.vehicle.flavour.settings)
        assert parameters.names - before

    read(test, VTOL, NEEDED)
