"""What is known of a vehicle, and what is rather not."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_mavlink.constants import Landed
from fleet_mavlink.messages import (
    Attitude,
    BatteryStatus,
    ExtendedSysState,
    GlobalPositionInt,
    GpsRawInt,
    Heartbeat,
    HomePosition,
    SysStatus,
    SystemTime,
)
from fleet_mavlink.state import VehicleState, reduce

BEAT = Heartbeat(2, 12, 0x80, 0x03040000, 4)
POSITION = GlobalPositionInt(5000, 473_977_420, 85_455_940, 498_000, 10_000, 100, -200, 50, 9000)


def after(*messages, state=None, at=0.0):
    state = state or VehicleState()
    for message in messages:
        state = reduce(state, message, at)
    return state


def test_nothing_is_known_at_first():
    state = VehicleState()
    assert not state.connected(0.0)
    assert not state.armed
    assert state.in_air is None
    assert state.home_altitude is None
    assert state.speed == math.inf


def test_a_vehicle_is_lost_after_three_seconds_and_back_with_the_second_heartbeat():
    state = after(BEAT, at=10.0)
    assert state.connected(13.0)
    assert not state.connected(13.1)
    state = after(BEAT, state=state, at=20.0)
    assert not state.connected(20.0)
    assert after(BEAT, state=state, at=21.0).connected(21.0)


def test_position_and_velocity_come_in_metres():
    state = after(BEAT, POSITION)
    assert state.position.altitude == 498.0
    assert state.relative_altitude == 10.0
    assert (state.velocity.x, state.velocity.y, state.velocity.z) == (1.0, -2.0, 0.5)
    assert state.heading == 90.0


def test_a_place_that_means_unknown_is_not_taken():
    assert after(GlobalPositionInt(1, 0, 0, 0, 0, 0, 0, 0, 65535)).position is None
    assert after(HomePosition(0, 0, 0)).home is None
    assert after(GpsRawInt(3, 0, 0, 0, 8, 0, 0)).fix is None
    assert after(GlobalPositionInt(1, 910_000_000, 1, 0, 0, 0, 0, 0, 0)).position is None


def test_a_heading_that_means_unknown_is_unknown():
    assert after(GlobalPositionInt(1, 1, 1, 0, 0, 0, 0, 0, 65535)).heading is None


def test_a_fix_is_reported_with_its_accuracy_and_forgotten_when_lost():
    state = after(GpsRawInt(6, 473_977_420, 85_455_940, 500_000, 255, 1200, 0))
    assert (state.fix.kind, state.fix.satellites) == ("rtk_fixed", None)
    assert (state.fix.horizontal_accuracy, state.fix.vertical_accuracy) == (1.2, None)
    assert after(GpsRawInt(1, 473_977_420, 85_455_940, 0, 3, 0, 0), state=state).fix is None


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_an_attitude_that_is_no_number_is_not_steered_by(bad):
    state = after(Attitude(1, bad, 0.0, 0.0), POSITION, at=1.0)
    assert state.attitude is None
    assert not state.knows_where(1.0)


def test_what_is_old_is_not_steered_by():
    state = after(Attitude(1, 0.0, 0.0, 0.0), POSITION, at=1.0)
    assert state.knows_where(2.0)
    assert not state.knows_where(2.1)


def test_an_unknown_battery_is_unknown():
    battery = after(SysStatus(0, 65535, -1, -1)).battery
    assert (battery.percent, battery.voltage, battery.current) == (None, None, None)
    empty = after(BatteryStatus(0, (65535,) * 10, -1, -1)).battery
    assert (empty.percent, empty.voltage, empty.current) == (None, None, None)


def test_the_batterys_own_message_is_preferred_and_only_the_first_counts():
    own = BatteryStatus(0, (4000, 4100, 65535, *(65535,) * 7), 1250, 61)
    state = after(own, SysStatus(0, 12000, 0, 99), BatteryStatus(1, (3000,) * 10, 0, 5))
    assert (state.battery.percent, state.battery.voltage, state.battery.current) == (61.0, 8.1, 12.5)


def test_home_is_as_high_as_the_newest_position_says():
    state = after(BEAT, POSITION, HomePosition(473_977_420, 85_455_940, 480_000))
    assert state.home_altitude == 488.0


def test_whether_it_flies_is_known_by_the_landed_state_then_by_the_motors_then_by_the_height():
    assert after(ExtendedSysState(Landed.LANDING)).in_air is True
    assert after(ExtendedSysState(Landed.ON_GROUND), BEAT, POSITION).in_air is False
    assert after(Heartbeat(2, 12), POSITION).in_air is False
    assert after(BEAT, POSITION).in_air is True
    assert after(BEAT).in_air is None
    assert after(ExtendedSysState(77)).landed is Landed.UNDEFINED


def test_a_clock_that_goes_back_means_a_reboot_and_forgets_all_but_the_heartbeat():
    state = after(BEAT, POSITION, HomePosition(1, 1, 1), SystemTime(60_000))
    state = after(SystemTime(900), state=state)
    assert state.reboots == 1
    assert (state.position, state.home, state.landed) == (None, None, Landed.UNDEFINED)
    assert state.heartbeat == BEAT
    assert after(SystemTime(1900), state=state).reboots == 1


def test_messages_that_cross_are_no_reboot():
    assert after(SystemTime(60_000), Attitude(58_500, 0, 0, 0), SystemTime(60_100)).reboots == 0


def test_the_clocks_wrap_after_49_days_is_no_reboot():
    assert after(SystemTime(0xFFFF_FF00), SystemTime(12)).reboots == 0


def test_a_heartbeat_from_the_boot_means_a_reboot_but_uninit_does_not():
    up = after(Heartbeat(2, 3, 0, 4, 3), POSITION)
    assert after(Heartbeat(2, 3, 0, 0, 1), state=up).reboots == 1
    assert after(Heartbeat(2, 3, 0, 0, 1), state=up).position is None
    assert after(Heartbeat(2, 12, 0, 4, 0), state=up).reboots == 0


def test_the_first_boot_is_no_reboot():
    assert after(Heartbeat(2, 3, 0, 0, 1), Heartbeat(2, 3, 0, 0, 3), SystemTime(100)).reboots == 0


@given(st.integers(-128, 127), st.integers(0, 65535), st.integers(-32768, 32767))
def test_a_charge_is_a_percentage_or_unknown(remaining, millivolts, centiamperes):
    battery = after(SysStatus(0, millivolts, centiamperes, remaining)).battery
    assert battery.percent is None or 0 <= battery.percent <= 100
    assert battery.voltage is None or battery.voltage > 0
    assert battery.current is None or battery.current >= 0
