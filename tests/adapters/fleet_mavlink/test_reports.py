"""What is told of a vehicle, and what is rather left out."""

import json

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet import GeoOrigin, GeoPoint
from fleet.wire.reports import sender, to_mqtt
from fleet_mavlink import reports
from fleet_mavlink.codec import Parser
from fleet_mavlink.constants import Landed
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.px4 import Px4
from fleet_mavlink.state import Angles, BatteryReading, Fix, VehicleState, reduce
from fleet_mavlink.statustext import Sentence

HOME = GeoOrigin(47.397742, 8.545594, 488.0)
PX4 = Px4()
NOTHING = VehicleState()


def test_of_a_vehicle_of_which_nothing_is_known_nothing_is_reported():
    assert reports.pose_report(NOTHING, HOME, 1.0) is None
    assert reports.gps_report(NOTHING, 9.0, 1.0) is None
    assert reports.battery_report(NOTHING, 1.0) is None
    assert reports.flight_state_report(NOTHING, PX4, 1.0) is None
    assert reports.flight_controller_report(NOTHING, PX4, (), 1, connected=True, stamp=1.0) is None
    assert reports.metrics_report(NOTHING, PX4, 1.0).power == {}


def test_without_an_origin_there_is_no_pose():
    state = VehicleState(position=GeoPoint(47.0, 8.0, 500.0), attitude=Angles(0, 0, 0))
    assert reports.pose_report(state, None, 1.0) is None


def test_a_fix_and_a_battery_are_reported_as_known():
    place = GeoPoint(47.0, 8.0, 500.0)
    state = VehicleState(
        fix=Fix(place, "3d", 12, 0.9, None),
        fix_at=8.0,
        battery=BatteryReading(50.0, 15.3, None),
        heading=270.0,
    )
    gps = reports.gps_report(state, 9.0, 7.0)
    assert (gps.point, gps.fix_type, gps.satellites, gps.heading) == (place, "3d", 12, 270.0)
    battery = reports.battery_report(state, 7.0)
    assert (battery.stamp, battery.percent, battery.voltage, battery.current) == (7.0, 50.0, 15.3, None)
    assert reports.metrics_report(state, PX4, 7.0).power == {"battery_percent": 50.0, "voltage": 15.3}


@pytest.mark.parametrize(
    ("state", "left", "expected"),
    [
        (mav.MAV_BATTERY_CHARGE_STATE_CHARGING, 600, {"charging": True}),
        (mav.MAV_BATTERY_CHARGE_STATE_OK, 600, {"charging": False, "estimated_runtime_minutes": 10.0}),
        (mav.MAV_BATTERY_CHARGE_STATE_LOW, 0, {"charging": False}),
        (mav.MAV_BATTERY_CHARGE_STATE_UNDEFINED, 0, {}),
    ],
)
def test_the_bytes_of_an_autopilot_that_is_charged_say_so_in_the_cloud(frame_of, state, left, expected):
    message = mav.MAVLink_battery_status_message(
        0, 0, 0, 300, [16000] + [65535] * 9, 120, 0, -1, 80, time_remaining=left, charge_state=state
    )
    (frame,) = Parser().feed(frame_of(message))
    report = reports.metrics_report(reduce(VehicleState(), frame.message, 1.0), PX4, 7.0)
    ((_, payload),) = to_mqtt(report, sender(source_type="edge"))
    power = json.loads(payload)["metrics"]["power"]
    assert power == {"battery_percent": 80.0, "voltage": 16.0, "current": 1.2, **expected}


def test_the_flight_controllers_state_is_reported_in_its_words():
    beat = Heartbeat(2, 12, 0x80, 0x05040000, 5)
    state = VehicleState(heartbeat=beat, landed=Landed.IN_AIR, prearm_ok=True, reboots=2, mission_current=3)
    said = [Sentence("Returning to launch", 6, 0.0)]
    report = reports.flight_controller_report(state, PX4, said, 9, connected=False, stamp=1.0)
    assert (report.armed, report.mode, report.failsafe, report.autopilot) == (True, "AUTO.RTL", True, "px4")
    assert (report.vehicle, report.system_id, report.reboots, report.connected) == ("quadrotor", 9, 2, False)
    assert [(text.text, text.severity) for text in report.status_texts] == [("Returning to launch", 6)]
    assert report.mission is None
    assert reports.flight_state_report(state, PX4, 1.0).is_flying


@pytest.mark.parametrize(
    ("severity", "level"),
    [
        (0, "CRITICAL"),
        (2, "CRITICAL"),
        (3, "ERROR"),
        (4, "WARNING"),
        (6, "INFO"),
        (7, "DEBUG"),
        (200, "DEBUG"),
    ],
)
def test_what_it_says_is_logged_at_its_weight(severity, level):
    assert reports.log_report(Sentence("x", severity, 0.0), 1.0).level == level
