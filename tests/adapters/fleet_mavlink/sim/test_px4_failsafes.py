"""Fail-safes of PX4 1.16.1: it holds first, and acts then."""

ACCEPTED, REJECTED = 0, 1


def test_a_lost_station_holds_and_returns_when_configured(flying):
    flying.set_param("NAV_DLL_ACT", 2)
    flying.set_param("COM_DL_LOSS_T", 5)
    flying.gcs = False
    flying.run(8)
    assert flying.pilot.failsafe == "gcs"
    assert flying.mode == "LOITER"
    flying.run(5)
    assert flying.mode == "RTL"
    flying.gcs = True
    flying.run(2)
    assert flying.mode == "RTL"


def test_a_critical_battery_holds_and_returns_and_the_user_overrules(flying):
    flying.vehicle.set_fault("low_battery", 6)
    flying.run(1)
    assert flying.mode == "LOITER"
    flying.run(5)
    assert flying.mode == "RTL"
    assert flying.set_mode("LOITER") == [ACCEPTED, ACCEPTED]
    flying.run(6)
    assert flying.mode == "LOITER"


def test_an_emptying_battery_lands_in_the_end(flying):
    flying.vehicle.set_fault("low_battery", 4)
    flying.run(6)
    assert flying.mode == "LAND"


def test_without_satellites_it_lands_and_loiter_is_refused(flying):
    flying.vehicle.set_fault("gps_loss", 1)
    flying.run(6)
    assert flying.mode == "LAND"
    assert flying.set_mode("LOITER") == [ACCEPTED, REJECTED]
