"""Machines with frames of their own: what the section takes, and what becomes of it."""

import pytest
from pydantic import ValidationError

from fleet import CanFrame
from fleet_quadruped.selfwalk.by_frames import FixedFrame, WalkerFrames, wire_of


def numbers(*names):
    return {name: {"at": 2 * at, "type": "i16", "scale": 0.001} for at, name in enumerate(names)}


TREE = {
    "velocity": {"id": 0x111, "fields": numbers("x", "y", "turn")},
    "start": ({"id": 0x421, "data": "01"},),
    "stand_up": {"id": 0x131, "data": "01"},
    "sit_down": {"id": 0x131, "data": "02"},
    "emergency_stop": {"id": 0x131, "data": "0300"},
    "height": {"id": 0x132, "fields": numbers("height")},
    "state": ({"id": 0x211, "fields": {"mode": {"at": 0, "type": "u8"}} | {"x": {"at": 2, "type": "i16"}}},),
    "slow": ({"id": 0x311, "fields": {"percent": {"at": 0, "type": "u8"}}},),
}


def frames(**changes):
    return WalkerFrames.model_validate(TREE | changes)


def refused(**changes):
    with pytest.raises(ValidationError) as caught:
        frames(**changes)
    return "; ".join(error["msg"] for error in caught.value.errors())


def test_each_command_is_its_frame_and_one_that_is_left_out_is_none():
    wire = wire_of(frames())
    assert wire.commands == {
        "stand_up": CanFrame(0x131, b"\x01"),
        "sit_down": CanFrame(0x131, b"\x02"),
        "emergency_stop": CanFrame(0x131, b"\x03\x00"),
    }
    more = wire_of(frames(recovery_stand={"id": 0x131, "data": ""}, reset_faults={"id": 0x131, "data": "05"}))
    assert more.commands["recovery_stand"] == CanFrame(0x131, b"")
    assert set(more.commands) == {*wire.commands, "recovery_stand", "reset_faults"}


def test_a_height_is_in_metres_and_a_machine_without_one_has_none():
    assert wire_of(frames()).height(0.25) == CanFrame(0x132, (250).to_bytes(2, "little"))
    assert wire_of(frames(height=None)).height is None


def test_the_rest_is_passed_on_as_it_is():
    given = frames()
    wire = wire_of(given)
    assert (wire.velocity, wire.state, wire.slow) == ((given.velocity,), given.state, given.slow)
    assert wire.start == (CanFrame(0x421, b"\x01"),)
    assert (wire.alive, wire.node, wire.setup, dict(wire.protected)) == ((), None, (), {})


@pytest.mark.parametrize("names", [("x", "y"), ("x", "y", "turn", "z"), ("x", "y", "yaw")])
def test_a_velocity_has_three_axes(names):
    words = refused(velocity={"id": 0x111, "fields": numbers(*names)})
    assert words == "Value error, a velocity has the fields x, y, turn"


def test_a_height_is_one_number():
    words = refused(height={"id": 0x132, "fields": numbers("height", "speed")})
    assert words == "Value error, it has one field, height"


def test_a_machine_tells_its_state():
    assert "at least 1 item" in refused(state=())


GUARDED = {"counter": {"at": 0}, "checksum": {"at": 1}}


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("0100FF", "byte 0 of data must be 00: its counter is there"),
        ("0001FF", "byte 1 of data must be 00: its checksum is there"),
        ("00", "byte 1 of data must be 00: its checksum is there"),
        ("", "byte 0 of data must be 00: its counter is there"),
    ],
)
def test_a_counter_and_a_checksum_have_bytes_of_their_own(data, words):
    with pytest.raises(ValidationError, match=words):
        FixedFrame.model_validate({"id": 1, "data": data} | GUARDED)
    assert FixedFrame.model_validate({"id": 1, "data": "0000FF"} | GUARDED).frame == CanFrame(1, b"\0\0\xff")


def test_frames_of_one_identifier_are_protected_alike():
    protected = {"id": 0x131, "data": "000001"} | GUARDED
    assert (
        refused(stand_up=protected) == "Value error, the frames 131h must have the same counter and checksum"
    )
    alike = dict.fromkeys(("stand_up", "sit_down", "emergency_stop"), protected)
    assert set(wire_of(frames(**alike)).protected) == {0x131}
    shared = TREE["velocity"] | {"id": 0x131}
    assert "131h" in refused(velocity=shared, **alike), "also a velocity"


@pytest.mark.parametrize("data", ["1", "0g", "00" * 9])
def test_data_is_up_to_eight_bytes(data):
    assert "pattern" in refused(stand_up={"id": 0x131, "data": data})
