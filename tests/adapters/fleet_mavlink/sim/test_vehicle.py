"""What holds for both flavours: faults, small answers, and that nothing from outside breaks it."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mav

FLAVOURS = ("ardupilot", "px4")
numbers = st.one_of(st.floats(width=32), st.integers(-3, 400).map(float), st.just(21196.0))


@pytest.fixture(params=FLAVOURS)
def either(request, bench):
    made = bench(request.param)
    made.run(0.2)
    return made


def test_timesync_echoes_and_tells_the_time_since_boot(either):
    either.run(1)
    (answer,) = either.tell(mav.MAVLink_timesync_message(0, 12345))
    assert answer.ts1 == 12345
    assert answer.tc1 == pytest.approx(either.now * 1e9, rel=0.05)
    assert either.tell(mav.MAVLink_timesync_message(5, 12345)) == []


def test_ping_is_answered_to_who_asked(either):
    (answer,) = either.tell(mav.MAVLink_ping_message(7, 3, 0, 0))
    assert (answer.seq, answer.target_system, answer.target_component) == (3, 255, 190)


@pytest.mark.parametrize(("flavour", "capabilities"), [("ardupilot", 0xFBEF), ("px4", 0xE8FF)])
def test_capabilities(bench, flavour, capabilities):
    made = bench(flavour)
    made.run(0.2)
    made.requests(520, 1)
    assert made.last("AUTOPILOT_VERSION").capabilities == capabilities


def test_lost_acknowledgements_do_not_keep_a_command_from_being_done(either):
    either.vehicle.set_fault("no_ack", 1)
    assert either.requests(400, 1) == []
    assert either.pilot.armed


def test_half_of_the_acknowledgements_can_be_lost(either):
    either.vehicle.set_fault("ack_loss", 0.5)
    answered = sum(len(either.requests(520, 1)) for _ in range(100))
    assert 25 < answered < 75


def test_a_slow_command_tells_progress_first(either):
    either.vehicle.set_fault("slow_ack", 2.0)
    assert either.requests(400, 1) == [5]
    either.run(2.1)
    assert either.last("COMMAND_ACK").result == 0


def test_not_ready_refuses_to_arm(either):
    either.vehicle.set_fault("not_ready", 1)
    if either.ardupilot:
        either.set_mode("GUIDED")
    assert either.requests(400, 1) != [0]
    either.vehicle.set_fault("not_ready", None)
    assert either.requests(400, 1) == [0]


def test_a_reboot_in_the_air_falls_and_is_seen_in_the_boot_time(either):
    either.climb()
    either.vehicle.set_fault("reboot", 1)
    either.run(4)
    assert either.body.grounded
    assert not either.pilot.armed
    assert either.pilot.uptime.ms < 3200


def test_a_reboot_is_dark_for_a_second(either):
    either.vehicle.set_fault("reboot", 1)
    either.heard.clear()
    either.run(0.9)
    assert either.heard == []
    either.run(1.2)
    assert either.said("HEARTBEAT")


def test_gps_loss_is_shown(either):
    either.vehicle.set_fault("gps_loss", 1)
    either.run(1.0)
    either.requests(512, 24)
    assert either.last("GPS_RAW_INT").fix_type <= 1
    either.vehicle.set_fault("gps_loss", None)
    either.run(0.1)
    either.requests(512, 24)
    assert either.last("GPS_RAW_INT").fix_type >= 3


def test_wind_moves_a_holding_vehicle_a_little(either):
    either.climb()
    either.vehicle.set_fault("wind", 10)
    either.run(20)
    assert 0.05 < math.hypot(either.body.north, either.body.east) < 5


def test_the_battery_drains_in_the_air(either):
    either.climb()
    before = either.pilot.battery.percent
    either.run(60)
    assert 2 < before - either.pilot.battery.percent < 8


def test_the_same_seed_flies_the_same_flight(bench):
    flights = []
    for _ in range(2):
        made = bench("px4", seed=7, faults={"wind": 8.0})
        made.climb()
        flights.append((made.body.north, made.body.east))
    assert flights[0] == flights[1]


def test_an_unknown_fault_is_refused(either):
    with pytest.raises(ValueError, match="did you mean 'gps_loss'"):
        either.vehicle.set_fault("gps_los", 1)


def test_a_file_transfer_is_answered_with_no_such_file(either):
    (answer,) = either.tell(mav.MAVLink_file_transfer_protocol_message(0, 1, 1, [5, 0, 0, 4] + [0] * 247))
    assert (answer.payload[3], answer.payload[5], answer.payload[12]) == (129, 4, 10)


@settings(max_examples=60, deadline=None)
@given(
    flavour=st.sampled_from(FLAVOURS),
    command=st.integers(0, 600),
    params=st.tuples(*[numbers] * 7),
    as_int=st.booleans(),
)
def test_no_command_breaks_it(bench, *, flavour, command, params, as_int):
    made = _aloft(bench, flavour)
    if as_int:
        place = (2**31 - 1, -(2**31), params[6])
        made.tell(
            mav.MAVLink_command_int_message(1, 1, int(command) % 13, command, 0, 0, *params[:4], *place)
        )
    else:
        made.tell(mav.MAVLink_command_long_message(1, 1, command, 0, *params))
    _is_sane(made)


@settings(max_examples=60, deadline=None)
@given(
    flavour=st.sampled_from(FLAVOURS),
    frame=st.integers(0, 30),
    mask=st.integers(0, 65535),
    values=st.tuples(*[numbers] * 8),
    local=st.booleans(),
)
def test_no_setpoint_breaks_it(bench, *, flavour, frame, mask, values, local):
    made = _aloft(bench, flavour)
    if not local:
        made.tell(
            mav.MAVLink_set_position_target_global_int_message(
                0, 1, 1, frame, mask, 2**31 - 1, -(2**31), *values[:4], 0, 0, 0, *values[4:6]
            )
        )
    else:
        made.tell(
            mav.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, frame, mask, *values[:6], 0, 0, 0, *values[6:8]
            )
        )
    _is_sane(made)


def _aloft(bench, flavour):
    """Put a vehicle that obeys setpoints into the air, without the flight there."""
    made = bench(flavour)
    made.run(0.2)
    made.body.down = -20.0
    if made.ardupilot:
        made.set_mode("GUIDED")
        made.requests(400, 1)
    else:
        made.requests(400, 1)
        made.drive(0, 0, 0)
        made.set_mode("OFFBOARD")
    return made


def _is_sane(made):
    made.run(0.3)
    body = made.body
    values = (body.north, body.east, body.down, body.vn, body.ve, body.vd, body.heading)
    assert all(map(math.isfinite, values))


def test_mode_and_flight_state_can_be_shown_late(either):
    either.run(1.0)
    either.vehicle.set_fault("state_lag", 1.5)
    if either.ardupilot:
        either.set_mode("GUIDED")
    assert either.requests(400, 1) == [0]
    either.run(1.3)
    assert not either.last("HEARTBEAT").base_mode & 128
    either.run(1.5)
    assert either.last("HEARTBEAT").base_mode & 128
