"""Aircraft of one process are told of each other."""

import asyncio
import contextlib
from uuid import UUID

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet.testing.clock import ManualClock
from fleet_mavlink.codec import pack
from fleet_mavlink.messages import ExtendedSysState, GlobalPositionInt, Heartbeat
from fleet_mavlink.traffic import Traffic, callsign_of, near
from fleet_mavlink.vehicle import Vehicle

HERE = (473_977_420, 85_455_940)
NORTH = 90  # degrees times 1e7 that are a metre


class SimFlight:
    """Aircraft, and what each is told."""

    def __init__(self):
        self.clock = ManualClock()
        self.traffic = Traffic()
        self.members = []

    def has(
        self, name, *, metres=0, height=20.0, armed=True, flies=True, twin=None, kind=2, velocity=(0, 0, 0)
    ):
        """Have an aircraft so many metres north."""
        vehicle = Vehicle(len(self.members) + 1, self.clock, lambda _message, _address: None)
        vehicle.handle_message(Heartbeat(kind, 3, 0x80 if armed else 0, 4, 4), None)
        vehicle.handle_message(ExtendedSysState(2 if flies else 1), None)
        place = (HERE[0] + metres * NORTH, HERE[1], int((488 + height) * 1000), int(height * 1000))
        vehicle.handle_message(GlobalPositionInt(1000, *place, *velocity, 9000), None)
        twin = twin or UUID(int=7 + len(self.members))
        member = self.traffic.member(vehicle, name, twin, simulated=True)
        self.members.append(member)
        return member.__enter__()

    def traffic_of(self, one):
        """Return what an aircraft is told, as pymavlink reads it."""
        said = near(one, self.traffic.aircraft.values(), self.clock.monotonic())
        return [mav.MAVLink(None).decode(bytearray(pack(each, 245, 191, 0))) for each in said]


@pytest.fixture
def air():
    return SimFlight()


def test_each_is_sent_the_other(air):
    one, other = air.has("kestrel-1"), air.has("Heron_2", metres=100, height=30.0, velocity=(300, 400, -150))
    (said,) = air.traffic_of(one)
    assert said.get_type() == "ADSB_VEHICLE"
    assert said.ICAO_address == other.address
    assert said.callsign == "HERON2"
    assert (said.lat, said.lon, said.altitude) == (HERE[0] + 100 * NORTH, HERE[1], 518_000)
    assert (said.hor_velocity, said.ver_velocity) == (500, 150)
    assert said.heading == pytest.approx(5313, abs=1)
    assert said.altitude_type == mav.ADSB_ALTITUDE_TYPE_GEOMETRIC
    assert said.emitter_type == mav.ADSB_EMITTER_TYPE_UAV
    valid = mav.ADSB_FLAGS_VALID_COORDS | mav.ADSB_FLAGS_VALID_ALTITUDE | mav.ADSB_FLAGS_VALID_HEADING
    valid |= mav.ADSB_FLAGS_VALID_VELOCITY | mav.ADSB_FLAGS_VALID_CALLSIGN | mav.ADSB_FLAGS_SIMULATED
    assert said.flags == valid | mav.ADSB_FLAGS_VERTICAL_VELOCITY_VALID
    assert [each.callsign for each in air.traffic_of(other)] == ["KESTREL1"]


@pytest.mark.parametrize(
    "other", [{"flies": False}, {"metres": 3000}, {"kind": 10}], ids=["on the ground", "far away", "a rover"]
)
def test_what_is_not_in_the_way_is_not_sent(air, other):
    one = air.has("kestrel")
    air.has("heron", **other)
    assert air.traffic_of(one) == []


def test_what_stands_on_the_ground_is_sent_nothing(air):
    one = air.has("kestrel", armed=False, flies=False)
    air.has("heron")
    assert air.traffic_of(one) == []


def test_an_aircraft_that_is_silent_is_not_sent_any_more(air):
    one = air.has("kestrel")
    air.has("heron", metres=10)
    air.clock.advance(4.0)
    assert [each.tslc for each in air.traffic_of(one)] == [4]
    air.clock.advance(2.0)
    assert air.traffic_of(one) == []


def test_of_many_the_nearest_are_sent(air):
    one = air.has("kestrel")
    for number in range(30):
        air.has(f"d{number}", metres=900 - number * 30)
    assert [each.callsign for each in air.traffic_of(one)] == [f"D{29 - number}" for number in range(10)]


def test_addresses_are_of_no_state_and_nobody_has_anothers(air):
    twin = UUID(int=7)
    one, other = air.has("kestrel", twin=twin), air.has("heron", twin=twin)
    assert one.address != other.address
    assert all(0xF80000 <= each.address < 0xFFFFFF for each in (one, other))
    air.members[1].__exit__(None, None, None)
    assert list(air.traffic.aircraft) == [one.address]


@pytest.mark.parametrize(
    ("name", "sign"), [("kestrel", "KESTREL"), ("survey-drone-12", "SURVEYDR"), ("_", "")]
)
def test_a_callsign_has_capitals_and_digits(name, sign):
    assert callsign_of(name) == sign


@pytest.mark.parametrize("traffic", ["off", "send"])
def test_it_is_reported_once_a_second_where_fleet_yaml_says_so(
    run_in_sim_time, sim_flight, monkeypatch, traffic
):
    shared = Traffic()

    @contextlib.asynccontextmanager
    async def opened():
        yield shared

    monkeypatch.setattr("fleet_mavlink.traffic._open_traffic", opened)

    async def main():
        async with sim_flight("ardupilot", traffic=traffic) as one, sim_flight("px4", name="heron") as other:
            for it in (one, other):
                it.deaf_to.add("ADSB_VEHICLE")
                await it.wait_until_known()
                await it.do("takeoff", altitude=5.0)
            one.ignored.clear()
            await asyncio.sleep(3.1)
            assert [each.callsign for each in one.ignored] == (["HERON"] * 3 if traffic == "send" else [])
            assert other.ignored == []
        assert shared.aircraft == {}

    run_in_sim_time(main())
