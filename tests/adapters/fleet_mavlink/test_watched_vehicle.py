"""One vehicle for the stations of one link: what reaches it, what is refused, and who it is taken from."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import LinkLost
from fleet_mavlink.codec import Frame
from fleet_mavlink.messages import CommandLong, ExtendedSysState
from fleet_mavlink.signing import Signer, key_of
from fleet_mavlink.watched_vehicle import descent_commands_of, stops_of
from tests.adapters.fleet_mavlink.watched_bench import STATION, WatchedBench, long

ARM, RTL, LAND, PAUSE, SET_MODE = 400, 20, 21, 193, 176
DENIED = mav.MAV_RESULT_DENIED
LOITER = 0x03040000


@pytest.fixture
def bench(harness):
    return lambda **more: WatchedBench(harness, **more)


def test_frames_of_the_vehicle_are_shown_as_they_are(bench, frame_of):
    it = bench()
    raw = frame_of(mav.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))
    it.watched.show(Frame(1, 1, CommandLong(1), raw=raw))
    assert it.frames == [raw]


@pytest.mark.parametrize("may", ["watch", "operate"])
@pytest.mark.parametrize("system", [255, 254])
def test_whoever_watches_reads(bench, may, system):
    it = bench(may=may).flies()
    it.send(mav.MAVLink_param_request_list_message(1, 1), system=system)
    it.send(long(512, 148), system=system)
    assert len(it.passed) == 2
    assert (it.frames, it.lost, it.halts) == ([], [], 0)


def test_what_is_the_stations_own_is_neither_passed_on_nor_refused(bench):
    it = bench()
    it.send(mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    assert (it.passed, it.frames) == ([], [])


@pytest.mark.parametrize(
    ("may", "system", "why"),
    [("watch", 255, "may: watch"), ("operate", 254, "station 255 operates, not 254")],
)
def test_a_command_of_one_that_may_not_is_refused_with_the_reason_and_nothing_is_taken(
    bench, may, system, why
):
    it = bench(may=may).flies()
    it.send(long(ARM, 1), system=system)
    (answer,) = it.refusals()
    assert (answer.command, answer.result) == (ARM, DENIED)
    assert (answer.get_srcSystem(), answer.get_srcComponent()) == (1, 1)
    assert (answer.target_system, answer.target_component) == (system, 190)
    assert it.reasons == f"COMMAND_LONG refused: {why}"
    assert (it.passed, it.lost, it.halts) == ([], [], 0)


def test_the_words_come_once_a_minute_and_the_answer_each_time(bench, caplog):
    it = bench(may="watch").flies()
    for _ in range(3):
        it.send(long(ARM, 1))
    assert len(it.refusals()) == 3
    assert it.reasons.count("refused") == 1
    it.it.clock.advance(61.0)
    it.send(long(ARM, 1))
    assert it.reasons.count("refused") == 2
    assert caplog.messages[0] == f"ground station 255/190 at {STATION}: COMMAND_LONG refused: may: watch"


@pytest.mark.parametrize("may", ["watch", "operate"])
def test_a_stop_of_anybody_reaches_the_vehicle_and_halts_it_by_our_own_means_too(bench, may):
    it = bench(may=may).flies()
    it.send(long(PAUSE, 0.0), system=200)
    assert (len(it.passed), it.halts) == (1, 1)
    assert it.lost == [("ground station 200/190", "OFFBOARD")]


def test_an_operator_that_moves_it_takes_it_over(bench):
    it = bench().flies(LOITER)
    it.send(long(RTL))
    assert (len(it.passed), it.halts) == (1, 0)
    assert it.lost == [("ground station 255/190", "AUTO.LOITER")]


def test_an_operator_that_arms_it_has_it_and_other_commands_on_the_ground_take_nothing(bench):
    it = bench()
    it.it.beat()
    it.send(long(SET_MODE, 1, 4, 6))
    assert it.lost == []
    it.send(long(ARM, 1))
    assert it.lost == [("ground station 255/190", "arms")]
    assert len(it.passed) == 2


def test_a_change_that_moves_nothing_takes_nothing(bench):
    it = bench().flies()
    it.send(mav.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 1.5, 9))
    assert (len(it.passed), it.lost) == (1, [])


@pytest.mark.parametrize(
    ("message", "passes"),
    [
        (long(RTL), True),
        (long(LAND), True),
        (long(SET_MODE, 1, 4, 6), True),  # AUTO.LAND
        (long(SET_MODE, 1, 4, 5), True),  # AUTO.RTL
        (long(SET_MODE, 1, 6), False),  # OFFBOARD
        (long(22), False),
        (long(ARM, 1), False),
        (long(PAUSE, 0.0), True),
    ],
)
def test_while_an_emergency_stop_is_set_an_operator_only_brings_it_down(bench, message, passes):
    it = bench().flies()
    it.stopped = True
    it.send(message)
    assert len(it.passed) == passes
    assert ("an emergency stop is set" in it.reasons) is not passes


def test_a_station_with_the_ids_of_this_edge_is_obeyed_in_nothing(bench):
    it = bench().flies()
    for message in (long(RTL), long(PAUSE, 0.0), mav.MAVLink_param_request_list_message(1, 1)):
        it.send(message, system=245, component=191)
    assert (it.passed, it.lost, it.halts) == ([], [], 0)
    assert "it has the ids of this edge" in it.reasons


def test_a_message_that_nobody_may_send_is_refused_to_an_operator_too(bench):
    it = bench().flies()
    it.send(mav.MAVLink_rc_channels_override_message(1, 1, *[1500] * 8))
    it.send(long(511, 30, 1_000_000))
    assert it.passed == []
    assert "it is not passed on through this edge" in it.reasons
    assert "this edge has set the rate of that message" in it.reasons


def test_a_refused_parameter_is_read_again_for_stations_that_know_no_refusal(bench):
    it = bench(may="watch").flies()
    it.send(mav.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 1.5, 9))
    (asked,) = mav.MAVLink(None).parse_buffer(bytearray(it.passed[0]))
    assert (asked.get_type(), asked.param_id) == ("PARAM_REQUEST_READ", "MIS_TAKEOFF_ALT")
    assert (asked.get_srcSystem(), asked.get_srcComponent()) == (255, 190)
    assert it.refusals("PARAM_ERROR")


KEY = "correct horse battery"


@pytest.mark.parametrize("key", [None, "another passphrase", KEY])
def test_a_vehicle_that_signs_takes_what_is_signed_with_its_key(bench, key):
    it = bench(key=KEY).flies()
    it.send(long(RTL), key=key)
    assert (len(it.passed), len(it.lost)) == ((1, 1) if key == KEY else (0, 0))
    if key != KEY:
        reader = Signer(key_of(KEY), it.it.clock.time)
        assert all(reader.accepts(frame) for frame in it.frames)
        assert it.refusals()[0].result == DENIED


def test_a_stop_that_is_not_signed_is_no_stop_and_an_unsigned_parameter_is_not_read(bench):
    it = bench(key=KEY).flies()
    it.send(long(PAUSE, 0.0))
    it.send(mav.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 1.5, 9))
    assert (it.passed, it.halts) == ([], 0)


def test_a_lost_link_of_the_vehicle_is_told_and_harms_nothing(bench, caplog):
    def lost(_frame, _address):
        raise LinkLost("the line is gone")

    it = bench().flies()
    it.link.send = lost
    it.send(long(RTL))
    assert f"{STATION}: not passed on: the line is gone" in caplog.text


def test_what_is_no_message_is_told_and_harms_nothing(bench, caplog):
    it = bench().flies()
    raw = bytearray(long(RTL).pack(mav.MAVLink(None)))
    raw[-1] ^= 0xFF
    it.watched.handle_frame(Frame(255, 190, CommandLong(1), raw=bytes(raw)))
    assert it.passed == []
    assert STATION in caplog.text


def commands(found):
    return [(each.command, each.param2, each.param3) for each in found]


def test_the_stops_of_a_vehicle_are_its_brakes_and_its_hold_but_no_landing(harness):
    px4 = harness("px4")
    assert stops_of(px4.vehicle) == descent_commands_of(px4.vehicle) == []  # not heard yet
    px4.beat(mode=LOITER, armed=True)
    assert (SET_MODE, 4.0, 3.0) in commands(stops_of(px4.vehicle))
    assert commands(descent_commands_of(px4.vehicle)) == [(SET_MODE, 4.0, 6.0), (SET_MODE, 4.0, 5.0)]
    copter = harness("ardupilot")
    copter.beat(mode=4, armed=True)
    assert set(commands(stops_of(copter.vehicle))) == {(SET_MODE, 17.0, 0.0)}
    quadplane = harness("ardupilot")
    quadplane.beat(mode=20, armed=True, kind=20)
    quadplane.receive(ExtendedSysState(2, 3))
    qland = 20.0
    assert (SET_MODE, qland, 0.0) not in commands(stops_of(quadplane.vehicle))
    assert (SET_MODE, qland, 0.0) in commands(descent_commands_of(quadplane.vehicle))


def test_a_vehicle_that_is_not_moved_here_is_stopped_and_has_no_way_down(harness):
    boat = harness("px4")
    boat.beat(armed=True, kind=11)
    assert stops_of(boat.vehicle)
    assert descent_commands_of(boat.vehicle) == []
