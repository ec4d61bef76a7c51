"""Fail-safes of ArduRover 4.6.3: FS_ACTION after FS_TIMEOUT, and never out of HOLD."""

HOLD, RTL = 4, 11
KEEP = 0x05C7


def test_a_station_that_falls_silent_makes_it_act_after_its_time(rover):
    rover.set_param("FS_GCS_ENABLE", 1)
    rover.set_param("FS_ACTION", 1)
    rover.stream(2.0, 2.0, mask=KEEP)
    rover.gcs = False
    rover.until(lambda: "GCS Failsafe" in rover.texts, limit=5.0)
    assert rover.mode == "RTL"


def test_a_lost_position_makes_it_hold(rover):
    rover.stream(2.0, 2.0, mask=KEEP)
    rover.set_param("SIM_GPS_DISABLE", 1)
    rover.until(lambda: "EKF failsafe" in rover.texts, limit=20.0)
    assert rover.mode == "HOLD"
