"""One link, many speakers: each vehicle gets what is its own."""

import asyncio
import contextlib

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import LinkLost, LinkRefused
from fleet.clock import SystemClock
from fleet.link.memory import MemoryRobot
from fleet.testing.clock import ManualClock
from fleet_mavlink.link_hub import LinkHub, open_hub
from fleet_mavlink.messages import CommandLong

COPTER = mav.MAVLink_heartbeat_message(2, 3, 81, 4, 3, 3)
GCS = mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
GIMBAL = mav.MAVLink_heartbeat_message(26, 8, 0, 0, 4, 3)
ONE, OTHER = ("10.0.0.1", 14550), ("10.0.0.2", 14550)


class Wire:
    """A link that keeps what is written."""

    url = "udpin:0.0.0.0:14550"

    def __init__(self):
        self.sent = []
        self.gone = False

    def send(self, data, address=None):
        if self.gone:
            raise LinkLost("gone")
        self.sent.append((address, data))
        return True


@pytest.fixture
def wire():
    return Wire()


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def hub(wire, clock):
    return LinkHub(wire, clock, 245, 191)


def ack(command, *, system=0, component=0):
    return mav.MAVLink_command_ack_message(command, 0, 0, 0, system, component)


def test_two_vehicles_on_one_link_are_distinguished(hub, frame_of):
    with hub.vehicle(1) as one, hub.vehicle(2) as two:
        hub.receive(frame_of(COPTER, system=1) + frame_of(COPTER, system=2), ONE)
        hub.receive(frame_of(mav.MAVLink_attitude_message(1, 0.5, 0, 0, 0, 0, 0), system=2), ONE)
        assert one.state.attitude is None
        assert two.state.attitude.roll == 0.5


@pytest.mark.parametrize(
    ("system", "component", "beat"),
    [(1, 154, GIMBAL), (1, 1, GIMBAL), (1, 191, COPTER), (255, 190, GCS), (0, 1, COPTER), (7, 1, COPTER)],
)
def test_who_is_not_our_vehicles_autopilot_is_not_heard(hub, frame_of, system, component, beat):
    with hub.vehicle(1) as vehicle:
        hub.receive(frame_of(beat, system=system, component=component), ONE)
        assert vehicle.state.heartbeat is None


def test_it_is_known_which_autopilots_are_there(hub, frame_of):
    hub.receive(frame_of(COPTER, system=9) + frame_of(COPTER, system=3) + frame_of(GCS, system=255), ONE)
    assert hub.heard == (3, 9)


def test_nothing_is_believed_before_the_first_heartbeat(hub, frame_of):
    with hub.vehicle(1) as vehicle:
        hub.receive(frame_of(mav.MAVLink_attitude_message(1, 0.5, 0, 0, 0, 0, 0)), ONE)
        assert vehicle.state.attitude is None


@pytest.mark.parametrize(
    ("target", "heard"), [((245, 191), 1), ((0, 0), 1), ((245, 0), 1), ((255, 190), 0), ((245, 190), 0)]
)
def test_answers_to_others_are_dropped(hub, frame_of, target, heard):
    with hub.vehicle(1) as vehicle:
        answers = []
        vehicle.on_ack = answers.append
        hub.receive(frame_of(COPTER), ONE)
        hub.receive(frame_of(ack(400, system=target[0], component=target[1])), ONE)
        assert len(answers) == heard


def test_each_vehicle_is_answered_where_it_was_heard(hub, wire, frame_of):
    with hub.vehicle(1) as one, hub.vehicle(2) as two:
        hub.receive(frame_of(COPTER, system=1), ONE)
        hub.receive(frame_of(COPTER, system=2), OTHER)
        one.send(CommandLong(400, 1))
        two.send(CommandLong(400, 2))
        assert [address for address, _ in wire.sent] == [ONE, OTHER]


def test_two_addresses_with_one_id_are_an_alarm_and_the_first_is_kept(hub, clock, frame_of):
    with hub.vehicle(1) as vehicle:
        hub.receive(frame_of(COPTER), ONE)
        clock.advance(1.0)
        hub.receive(frame_of(mav.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3)), OTHER)
        hub.receive(frame_of(COPTER), ONE)
        assert vehicle.clashing
        assert vehicle.address == ONE
        assert vehicle.flavour.name == "ardupilot"


def test_an_autopilot_that_restarts_and_speaks_from_elsewhere_is_no_second_one(hub, clock, frame_of):
    with hub.vehicle(1) as vehicle:
        for _ in range(2):
            hub.receive(frame_of(COPTER), ONE)
            clock.advance(1.0)
        for _ in range(5):
            hub.receive(frame_of(COPTER), OTHER)
            assert not vehicle.clashing
            clock.advance(1.0)
        assert vehicle.address == OTHER
        assert vehicle.connected
        assert not vehicle.trust.counts


def test_only_those_that_are_heard_now_and_are_nobodys_are_reported(hub, clock, frame_of):
    with hub.vehicle(1):
        for system in (1, 2, 3):
            hub.receive(frame_of(COPTER, system=system), ONE)
        with hub.vehicle(2):
            assert hub.unclaimed == (3,)
            clock.advance(3.5)
            hub.receive(frame_of(COPTER, system=1), ONE)
            assert (hub.heard, hub.unclaimed) == ((1,), ())


def test_an_alarm_ends_three_seconds_after_the_second_fell_silent(hub, clock, frame_of):
    with hub.vehicle(1) as vehicle:
        hub.receive(frame_of(COPTER), ONE)
        hub.receive(frame_of(COPTER), OTHER)
        for _ in range(4):
            clock.advance(1.0)
            hub.receive(frame_of(COPTER), ONE)
        assert not vehicle.clashing


def test_a_vehicle_that_fell_silent_may_come_back_from_elsewhere(hub, clock, frame_of):
    with hub.vehicle(1) as vehicle:
        hub.receive(frame_of(COPTER), ONE)
        clock.advance(3.5)
        hub.receive(frame_of(COPTER), OTHER)
        assert not vehicle.clashing
        assert vehicle.address == OTHER


def test_a_frame_may_be_cut_by_its_sender_but_not_joined_with_anothers(hub, frame_of):
    with hub.vehicle(1) as vehicle:
        data = frame_of(COPTER)
        hub.receive(data[:9], ONE)
        hub.receive(data[9:], OTHER)
        assert vehicle.state.heartbeat is None
        hub.receive(data[9:], ONE)
        assert vehicle.state.heartbeat is not None


def test_many_senders_of_half_frames_do_not_pile_up(hub):
    for port in range(2000):
        hub.receive(b"\xfd\x09", ("10.0.0.9", port))
    assert len(hub._parsers) <= 256


def test_a_vehicle_has_one_robot(hub):
    with hub.vehicle(1):
        with pytest.raises(LinkRefused, match="two robots have system_id 1"), hub.vehicle(1):
            pass
        with hub.vehicle(2):
            pass
    with hub.vehicle(1):
        pass


def test_a_fault_in_one_message_does_not_end_the_link(hub, frame_of, caplog):
    with hub.vehicle(1) as vehicle:
        vehicle.on_heartbeat = lambda: 1 / 0
        hub.receive(frame_of(COPTER), ONE)
        vehicle.on_heartbeat = lambda: None
        hub.receive(frame_of(COPTER), ONE)
        assert vehicle.state.beats >= 2
    assert "dropped" in caplog.text


def test_what_is_sent_beside_the_loop_is_well_formed(hub, wire, frame_of):
    with hub.vehicle(1) as vehicle:
        hub.receive(frame_of(COPTER), ONE)
        hub.send_from_any_thread([CommandLong(176, 1), CommandLong(192, 1)], vehicle)
    read = mav.MAVLink(None).parse_buffer(bytearray(b"".join(data for _, data in wire.sent)))
    assert [message.command for message in read] == [176, 192]
    assert {address for address, _ in wire.sent} == {ONE}


async def test_it_beats_with_an_id_of_its_own_until_it_is_left():
    beating = asyncio.Event()
    with MemoryRobot("hub-beat", lambda _: beating.set() or b"") as robot:
        async with open_hub(["memory:hub-beat"], SystemClock(), 245, 191), asyncio.timeout(60):
            await beating.wait()
        (beat,) = mav.MAVLink(None).parse_buffer(bytearray(robot.heard[0]))
        assert (beat.get_srcSystem(), beat.get_srcComponent()) == (245, 191)
        assert (beat.type, beat.autopilot) == (mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID)


def test_it_beats_once_a_second_to_everyone_it_has_heard(run_in_sim_time, wire, clock, frame_of):
    async def main():
        hub = LinkHub(wire, clock, 245, 191)
        with hub.vehicle(1), hub.vehicle(2), hub.vehicle(3):
            hub.receive(frame_of(COPTER, system=1), ONE)
            hub.receive(frame_of(COPTER, system=2), OTHER)
            hub.receive(frame_of(COPTER, system=3), ONE)
            beating = asyncio.ensure_future(hub.beat())
            await asyncio.sleep(9.5)
            beating.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await beating
        addresses = [address for address, _ in wire.sent]
        assert addresses.count(ONE) == addresses.count(OTHER) == 10

    run_in_sim_time(main())


def test_it_stops_beating_on_a_link_that_fell(run_in_sim_time, wire, clock):
    wire.gone = True
    run_in_sim_time(asyncio.wait_for(_beats(LinkHub(wire, clock, 245, 191)), 5))
    assert wire.sent == []


async def _beats(hub):
    await hub.beat()
