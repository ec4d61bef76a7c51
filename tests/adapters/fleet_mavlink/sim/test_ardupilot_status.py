"""Health of ArduPilot as it reports it."""

from pymavlink.dialects.v20 import all as mav


def test_the_status_goes_by_being_landed(ap):
    ap.run(0.2)
    ap.set_mode("GUIDED")
    ap.requests(400, 1)
    ap.run(1.1)
    assert ap.last("HEARTBEAT").system_status == mav.MAV_STATE_STANDBY
    ap.requests(22, 0, 0, 0, 0, 0, 0, 10)
    ap.run(6)
    assert ap.last("HEARTBEAT").system_status == mav.MAV_STATE_ACTIVE
