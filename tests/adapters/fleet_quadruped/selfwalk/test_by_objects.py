"""CANopen machines: what the section takes, and the PDOs and writes that become of it."""

import struct

import pytest
from pydantic import ValidationError

from fleet import CanFrame
from fleet_quadruped.any_description import load_body
from fleet_quadruped.drives.cia402.setup import final_values
from fleet_quadruped.frames import FrameDecoder, encode
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.selfwalk.by_objects import Objects, wire_of

CANOPEN = EXAMPLE.with_name("self-walking-canopen.yaml")
OFF = 1 << 31


def numbers(*names, kind="i16", index=0x2100, **scale):
    return {
        name: {"index": index, "sub": sub, "type": kind} | scale for sub, name in enumerate(names, start=1)
    }


TREE = {
    "node": 9,
    "velocity": numbers("x", "y", "turn", scale=0.001),
    "stand_up": {"index": 0x2200, "type": "u8", "value": 1},
    "sit_down": {"index": 0x2200, "sub": 3, "type": "u16", "value": 0x102},
    "emergency_stop": {"index": 0x2201, "type": "u32", "value": 0xF0E0D0C0},
    "state": {"mode": {"index": 0x2300, "type": "u8"}},
}


def objects(**changes):
    return Objects.model_validate(TREE | changes)


def wire(silence=0.3, **changes):
    return wire_of(objects(**changes), silence)


def refused(**changes):
    with pytest.raises(ValidationError) as caught:
        objects(**changes)
    return "; ".join(error["msg"] for error in caught.value.errors())


def finals(given):
    return {item.name: item.value for item in final_values(list(given.setup))}


def test_the_example_is_mapped_in_the_order_of_its_description():
    given = load_body(CANOPEN).wire
    (velocity,) = given.velocity
    assert velocity.id == 0x209
    assert [(name, field.at) for name, field in velocity.fields.items()] == [("x", 0), ("y", 2), ("turn", 4)]
    assert [frame.id for frame in given.state] == [0x189, 0x289, 0x389]
    assert [frame.id for frame in given.slow] == [0x489]
    mapped = [item.value for item in given.setup if item.place == 0x1600 and item.sub > 0]
    assert mapped == [0x2100_0110, 0x2100_0210, 0x2100_0310]


def test_a_velocity_is_taken_at_once_a_state_is_sent_with_each_sync_and_the_rest_with_every_tenth():
    found = finals(wire(slow=numbers("percent", kind="u8", index=0x2400)))
    assert (found["1400h:1"], found["1400h:2"]) == (0x209, 255)
    assert (found["1800h:1"], found["1800h:2"]) == (0x189, 1)
    assert (found["1801h:1"], found["1801h:2"]) == (0x289, 10)
    assert found["1A01h:1"] == 0x2400_0108


def test_entries_that_do_not_fit_into_eight_bytes_go_into_the_next_pdo():
    given = wire(state=numbers("mode", "x", "y", kind="f32", index=0x2301))
    assert [(frame.id, list(frame.fields), frame.length) for frame in given.state] == [
        (0x189, ["mode", "x"], 8),
        (0x289, ["y"], 4),
    ]
    assert finals(given)["1A00h:0"] == 2
    assert finals(given)["1A01h:1"] == 0x2301_0320


def test_a_pdo_that_is_full_is_full():
    (frame,) = wire(state=numbers(*"abcd", kind="u16")).state
    assert frame.length == 8
    assert len(wire(state=numbers(*"abcd", kind="u16") | numbers("e", kind="u8", index=0x2500)).state) == 2


def test_numbers_come_back_as_they_were_mapped():
    (frame,) = wire().velocity
    data = encode(frame, {"x": 0.5, "y": -0.25, "turn": 1.0})
    assert data == struct.pack("<hhh", 500, -250, 1000)
    assert FrameDecoder([frame]).decode(0x209, data) == pytest.approx({"x": 0.5, "y": -0.25, "turn": 1.0})


@pytest.mark.parametrize(
    ("command", "data"),
    [
        ("stand_up", "2f00220001000000"),
        ("sit_down", "2b00220302010000"),
        ("emergency_stop", "23012200c0d0e0f0"),
    ],
)
def test_a_command_is_one_object_that_is_written(command, data):
    assert wire().commands[command] == CanFrame(0x609, bytes.fromhex(data))


def test_a_command_that_is_left_out_is_none():
    assert set(wire().commands) == {"stand_up", "sit_down", "emergency_stop"}
    more = {name: {"index": 0x2202, "type": "u8", "value": 0} for name in ("recovery_stand", "reset_faults")}
    assert set(wire(**more).commands) == {"stand_up", "sit_down", "emergency_stop", *more}


def test_a_height_is_written_in_its_own_unit():
    height = {"index": 0x2202, "type": "u16", "scale": 0.001}
    assert wire(height=height).height(0.25) == CanFrame(0x609, bytes.fromhex("2b022200fa000000"))
    assert wire(height=height | {"type": "f32", "scale": 1.0}).height(0.25) == CanFrame(
        0x609, bytes.fromhex("23022200") + struct.pack("<f", 0.25)
    )
    assert wire().height is None


@pytest.mark.parametrize(("silence", "milliseconds"), [(0.3, 300), (0.0625, 62), (1.5, 1500)])
def test_our_silence_stops_the_machine_by_its_heartbeat_consumer(silence, milliseconds):
    watchdog = wire(silence).setup[0]
    assert (watchdog.name, watchdog.size, watchdog.value) == ("1016h:1", 4, 0x7F << 16 | milliseconds)


def test_the_settings_of_the_description_are_written_before_the_mapping():
    setting = {"index": 0x1029, "sub": 1, "type": "u8", "value": 1}
    written = wire(setup=(setting,)).setup
    assert (written[1].name, written[1].size, written[1].value) == ("1029h:1", 1, 1)
    assert (written[2].name, written[2].value) == ("1400h:1", OFF | 0x209)


def test_our_heartbeat_and_a_sync_go_before_each_velocity():
    given = wire()
    assert given.alive == (CanFrame(0x77F, b"\x05"), CanFrame(0x080, b""))
    assert (given.node, given.start, dict(given.protected)) == (9, (), {})


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"velocity": numbers("x", "y", "yaw")}, "a velocity has the entries x, y, turn"),
        ({"velocity": numbers("x", "y")}, "a velocity has the entries x, y, turn"),
        ({"state": numbers(*"abcdefghi", kind="f32")}, "these do not fit into 4 PDOs of eight bytes"),
        ({"node": 0}, "greater than or equal to 1"),
        ({"node": 127}, "less than or equal to 126"),  # ours
        ({"stand_up": {"index": 0x2200, "type": "i8", "value": 1}}, "'u8', 'u16' or 'u32'"),
        ({"stand_up": {"index": 0x0FFF, "type": "u8", "value": 1}}, "greater than or equal to 4096"),
        ({"stand_up": {"index": 0x2200, "type": "u8", "value": 256}}, "256 does not fit into u8, 0 to 255"),
        (
            {"setup": ({"index": 0x1029, "type": "u16", "value": 65536},)},
            "65536 does not fit into u16, 0 to 65535",
        ),
    ],
)
def test_what_cannot_be_written_or_mapped_is_refused(changes, expected):
    assert expected in refused(**changes)


def test_state_and_slow_values_share_the_four_pdos_of_a_machine():
    fits = {"state": numbers(*"abcdef", kind="f32"), "slow": numbers("percent", kind="u8")}
    assert len(wire(**fits).state) == 3
    with pytest.raises(ValueError, match="objects: state and slow do not fit into 4 PDOs of eight bytes"):
        wire(**fits | {"state": numbers(*"abcdefgh", kind="f32")})
