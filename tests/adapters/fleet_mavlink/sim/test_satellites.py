"""Lost satellites, as ap_copter_gps_loss and px4_gps_loss recorded them."""

import pytest


def flown(bench, flavour):
    it = bench(flavour)
    it.climb()
    return it


def test_arducopters_estimator_fails_in_the_recorded_steps(bench):
    flying = flown(bench, "ardupilot")
    for message in (24, 32, 33, 193):
        flying.requests(511, message, 100_000)
    flying.vehicle.set_fault("gps_loss", 1)
    flying.run(2.0)
    fix = flying.last("GPS_RAW_INT")
    assert (fix.fix_type, fix.satellites_visible, fix.eph) == (1, 3, 121)
    assert fix.lat, "the last place is told on"
    flying.run(6.5)
    assert flying.last("EKF_STATUS_REPORT").flags == 0x0025
    flying.run(7.5)
    assert flying.last("EKF_STATUS_REPORT").flags == 0x00A7
    local = len(flying.said("LOCAL_POSITION_NED"))
    flying.run(5.0)
    assert len(flying.said("LOCAL_POSITION_NED")) == local
    off = (flying.last("GLOBAL_POSITION_INT").lon - 85455940) * 0.0075
    assert off == pytest.approx(4.0, abs=1.5)


def test_px4s_estimator_fails_in_the_recorded_steps_and_runs_away(bench):
    flying = flown(bench, "px4")
    for message in (24, 33, 230):
        flying.requests(511, message, 100_000)
    flying.vehicle.set_fault("gps_loss", 1)
    flying.run(0.7)
    fix = flying.last("GPS_RAW_INT")
    assert (fix.fix_type, fix.satellites_visible, fix.eph) == (0, 0, 10000)
    assert fix.lat, "the last place is told on"
    assert flying.mode == "LOITER"
    flying.run(4.8)
    assert flying.mode == "LAND"
    flying.run(1.0)
    assert flying.last("ESTIMATOR_STATUS").flags == 0x0365
    flying.run(2.0)
    assert flying.last("ESTIMATOR_STATUS").flags == 0x0065
    flying.run(21.5)
    off = (flying.last("GLOBAL_POSITION_INT").lon - 85455940) * 0.0075
    assert off == pytest.approx(170.0, abs=30.0)


def test_with_satellites_again_px4_goes_back_to_what_was_chosen(bench):
    flying = flown(bench, "px4")
    flying.vehicle.set_fault("gps_loss", 1)
    flying.run(6.0)
    assert flying.mode == "LAND"
    flying.vehicle.set_fault("gps_loss", None)
    flying.run(2.5)
    assert flying.mode == "LOITER"
