"""Components beside the autopilot: each with its own heartbeat, and answers for what is meant for it."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.components import ACCESSORIES, Component, SimCamera, framed
from fleet_mavlink.sim.vehicle import SimVehicle

ACCEPTED, UNSUPPORTED = 0, 3
CAPTURE = mav.MAV_CMD_IMAGE_START_CAPTURE


@pytest.fixture
def vehicle():
    made = SimVehicle("px4", ready_after=0.0, system_id=7)
    made.step(0.5)
    return made


def read(frames):
    parser = mav.MAVLink(None)
    return [message for frame in frames for message in parser.parse_buffer(bytearray(frame))]


def over(component, seconds, *, begin=0.0):
    """Let time pass in steps of 50 ms; return what the component says, with its times."""
    said = []
    for step in range(round(seconds * 20)):
        now = begin + step * 0.05
        said += [(now, message) for message in read(component.step(now))]
    return said


def of(said, kind):
    return [message for _, message in said if message.get_type() == kind]


def command(target, number=CAPTURE, pictures=1.0):
    message = mav.MAVLink_command_long_message(7, target, number, 0, 0.0, 0.0, pictures, 1.0, 0.0, 0.0, 0.0)
    message._header = mav.MAVLink_header(message.id, srcSystem=245, srcComponent=191)
    return message


@pytest.mark.parametrize(
    ("name", "component", "kind"),
    [("gimbal", 154, 26), ("adsb", 156, 27), ("camera", 100, 30), ("remote_id", 236, 34)],
)
def test_each_beats_once_a_second_in_its_own_name_and_as_no_autopilot(vehicle, name, component, kind):
    beats = of(over(ACCESSORIES[name](vehicle), 10.0), "HEARTBEAT")
    assert len(beats) == 10
    assert {(beat.get_srcSystem(), beat.get_srcComponent()) for beat in beats} == {(7, component)}
    assert {(beat.type, beat.autopilot, beat.base_mode) for beat in beats} == {(kind, 8, 0)}


def test_frames_are_numbered_and_the_number_wraps(vehicle):
    packer = mav.MAVLink(None, srcSystem=7, srcComponent=9)
    beat = mav.MAVLink_heartbeat_message(27, 8, 0, 0, 4, 3)
    assert [frame[4] for frame in framed(packer, [beat] * 300)] == [number % 256 for number in range(300)]


def test_what_only_beats_answers_nothing(vehicle):
    assert Component(vehicle).requested(command(156), 1.0) is None


def test_a_picture_is_acknowledged_and_reported_after_its_exposure(vehicle):
    camera = SimCamera(vehicle)
    (answer,) = camera.requested(command(100), 1.0)
    assert (answer.command, answer.result) == (CAPTURE, ACCEPTED)
    assert (answer.target_system, answer.target_component) == (245, 191)
    said = [(now, each) for now, each in over(camera, 2.0, begin=1.0) if each.get_type() != "HEARTBEAT"]
    ((now, taken),) = said
    assert now == pytest.approx(1.4, abs=0.06)
    assert (taken.image_index, taken.capture_result, taken.file_url) == (1, 1, "/DCIM/0001.jpg")


def test_a_picture_has_the_place_where_it_was_taken(vehicle):
    camera = SimCamera(vehicle)
    camera.requested(command(100), 1.0)
    (taken,) = of(over(camera, 2.0, begin=1.0), "CAMERA_IMAGE_CAPTURED")
    assert (taken.lat / 1e7, taken.lon / 1e7) == pytest.approx((47.397742, 8.545594), abs=1e-6)
    assert taken.alt == pytest.approx(488_000, abs=1500)  # mm
    assert taken.relative_alt == pytest.approx(0, abs=1500)


def test_pictures_are_counted_and_a_failed_one_too(vehicle):
    camera = SimCamera(vehicle)
    vehicle.set_fault("camera_fails", 1.0)
    camera.requested(command(100), 1.0)
    vehicle_fails = of(over(camera, 1.0, begin=1.0), "CAMERA_IMAGE_CAPTURED")
    vehicle.set_fault("camera_fails", None)
    camera.requested(command(100), 3.0)
    works = of(over(camera, 1.0, begin=3.0), "CAMERA_IMAGE_CAPTURED")
    assert [(each.image_index, each.capture_result) for each in vehicle_fails + works] == [(1, 0), (2, 1)]


@pytest.mark.parametrize(
    "message", [command(100, pictures=0.0), command(100, pictures=3.0), command(100, number=2500)]
)
def test_a_camera_takes_one_picture_at_a_time_and_does_nothing_else(vehicle, message):
    camera = SimCamera(vehicle)
    (answer,) = camera.requested(message, 1.0)
    assert (answer.command, answer.result) == (message.command, UNSUPPORTED)
    assert not of(over(camera, 2.0, begin=1.0), "CAMERA_IMAGE_CAPTURED")


@pytest.mark.parametrize("message", [command(1), command(0), mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)])
def test_what_is_not_for_the_camera_is_not_its_own(vehicle, message):
    assert SimCamera(vehicle).requested(message, 1.0) is None


def test_a_gimbal_tells_its_attitude_and_is_that_of_the_autopilot(vehicle):
    gimbal = ACCESSORIES["gimbal"](vehicle)
    vehicle.equipment.gimbal.pitch = -30.0
    told = of(over(gimbal, 2.0), "GIMBAL_DEVICE_ATTITUDE_STATUS")
    assert 8 <= len(told) <= 11
    assert told[-1].q[2] == pytest.approx(-0.2588, abs=1e-3)


def test_a_transmitter_tells_each_second_what_it_misses_and_nothing_while_it_is_broken(vehicle):
    transmitter = ACCESSORIES["remote_id"](vehicle)
    told = of(over(transmitter, 5.0), "OPEN_DRONE_ID_ARM_STATUS")
    assert len(told) == 5
    assert {each.status for each in told} == {mav.MAV_ODID_ARM_STATUS_PRE_ARM_FAIL_GENERIC}
    assert told[-1].error.startswith("missing ")
    vehicle.set_fault("remote_id_silent", 1.0)
    assert not of(over(transmitter, 5.0, begin=10.0), "OPEN_DRONE_ID_ARM_STATUS")
