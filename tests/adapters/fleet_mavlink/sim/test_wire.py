"""Frames in, frames out."""

import pytest
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.vehicle import SimVehicle
from fleet_mavlink.sim.wire import MavlinkWire

HEARTBEAT = mav.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)


def frame(message, system=255, component=190):
    return bytes(message.pack(mav.MAVLink(None, system, component)))


def parsed(frames):
    parser = mav.MAVLink(None)
    parser.robust_parsing = True
    return [m for data in frames for m in parser.parse_buffer(data) or () if m.get_type() != "BAD_DATA"]


def made(flavour="ardupilot", accessories=(), **setup):
    return MavlinkWire(SimVehicle(flavour, ready_after=0.0, **setup), accessories)


def version_request():
    return frame(mav.MAVLink_command_long_message(1, 1, 520, 0, 1, 0, 0, 0, 0, 0, 0))


def test_frames_are_mavlink_2_with_a_running_sequence():
    wire = made()
    frames = [data for tick in range(1, 200) for data in wire.step(tick * 0.05)]
    assert all(data[0] == 0xFD for data in frames)
    assert [data[4] for data in frames] == [number % 256 for number in range(len(frames))]
    assert {(data[5], data[6]) for data in frames} == {(1, 1)}


def test_a_command_is_answered_at_once():
    wire = made()
    wire.step(0.1)
    assert [m.get_type() for m in parsed(wire.receive(version_request(), 0.1))] == [
        "AUTOPILOT_VERSION",
        "COMMAND_ACK",
    ]


def test_a_frame_may_come_byte_by_byte():
    wire = made()
    wire.step(0.1)
    answers = [data for byte in version_request() for data in wire.receive(bytes([byte]), 0.1)]
    assert len(parsed(answers)) == 2


def test_garbage_between_frames_is_skipped():
    wire = made()
    wire.step(0.1)
    assert parsed(wire.receive(b"\x00\xfd\x09garbage\n" * 3 + version_request() * 2, 0.1))


def test_ardupilot_greets_a_stream_with_text_and_px4_does_not():
    assert made().greeting()[0].startswith(b"\n\nInit ArduCopter")
    assert made("px4").greeting() == []


def test_accessories_only_beat():
    wire = made(accessories=("gimbal", "adsb"))
    seen = {(m.get_srcComponent(), m.get_type()) for n in range(1, 60) for m in parsed(wire.step(n * 0.05))}
    assert {(154, "HEARTBEAT"), (156, "HEARTBEAT"), (1, "HEARTBEAT")} <= seen


@pytest.mark.parametrize(("fault", "value", "share"), [("loss", 0.5, 0.5), ("silent", 1, 0.0)])
def test_wire_faults_hit_what_is_sent(fault, value, share):
    counts = []
    for faults in ({}, {fault: value}):
        wire = made("px4", faults=faults)
        counts.append(sum(len(wire.step(tick * 0.05)) for tick in range(1, 101)))
    assert counts[1] == pytest.approx(share * counts[0], abs=0.1 * counts[0])


def test_a_delayed_command_is_answered_late():
    wire = made(faults={"delay": 0.5})
    wire.step(0.1)
    assert wire.receive(version_request(), 0.1) == []
    answers = [
        m.get_type()
        for tick in range(3, 30)
        for m in parsed(wire.step(tick * 0.05))
        if m.get_type() == "COMMAND_ACK"
    ]
    assert answers == ["COMMAND_ACK"]
