"""Health of PX4 as it reports it."""

from pymavlink.dialects.v20 import all as mav

ACCEPTED, REJECTED, DENIED = 0, 1, 2


def test_a_terminated_flight_stays_armed_and_refuses_everything(flying):
    assert flying.requests(185, 0) == [DENIED]
    assert flying.requests(185, 1) == [ACCEPTED]
    flying.run(3)
    heartbeat = flying.last("HEARTBEAT")
    assert heartbeat.base_mode & 128
    assert (heartbeat.custom_mode, heartbeat.system_status) == (0x000A0000, 8)
    assert flying.body.grounded
    assert flying.set_mode("LOITER") == [ACCEPTED, REJECTED]


def test_the_status_goes_by_the_motors_and_the_prearm_bit_by_the_checks(bench):
    px4 = bench("px4", ready_after=None)
    px4.run(3.8)
    assert px4.last("HEARTBEAT").system_status == mav.MAV_STATE_UNINIT
    assert not px4.pilot.status.sensors()[2] & mav.MAV_SYS_STATUS_PREARM_CHECK
    px4.run(1.5)
    assert px4.last("HEARTBEAT").system_status == mav.MAV_STATE_STANDBY
    assert px4.pilot.status.sensors()[2] & mav.MAV_SYS_STATUS_PREARM_CHECK
    px4.requests(400, 1)
    px4.run(1.1)
    assert px4.last("HEARTBEAT").system_status == mav.MAV_STATE_ACTIVE
