import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.drives.moteus import frames as wire
from fleet_quadruped.drives.moteus.frames import ServoCommand


def test_the_example_of_the_protocols_document_is_understood():
    command = wire.unpack(bytes.fromhex("01000a07206000200150ff140400130d"))
    assert [(part.kind, part.start, part.values or part.size) for part in command] == [
        (0, wire.MODE, (10,)),
        (0, wire.COMMAND, (0x60, 0x120, -176)),
        (1, wire.MODE, 4),
        (1, wire.VOLTAGE, 3),
    ]
    answer = wire.unpack(bytes.fromhex("2404000a005000000170ff230d181400"))
    assert [part.values for part in answer] == [(10, 80, 256, -144), (24, 20, 0)]


def test_a_golden_command():
    demand = ServoCommand(0.5, 0.25, 1.0, 0.5, 0.25, 8.0, 0.125)
    assert (
        wire.pack_demand(wire.OBEYS, demand).hex()
        == (
            "01000a0c08200000003f0000803e0000803f0000003f0000803e000000410000c07f0000003e0228ffff1c040014040c50"
        )[: 2 * 48]
    )


def test_frames_have_a_length_that_can_fd_has():
    demand = ServoCommand(*[0.0] * 7)
    for data in (wire.pack_demand(10, demand), wire.pack_mode(0), wire.pack_query(), wire.pack_text("x\n")):
        assert len(data) in {8, 12, 16, 20, 24, 32, 48, 64}
        assert wire.unpack(data) is not None


@given(st.binary(max_size=64))
def test_no_frame_breaks_the_decoder(data):
    parts = wire.unpack(data)
    assert parts is None or wire.registers(parts) is not None


@pytest.mark.parametrize("place", range(1, 7))
def test_what_is_no_number_is_not_sent(place):
    values = [0.0] * 7
    values[place] = math.nan
    with pytest.raises(ValueError, match="cannot send"):
        wire.pack_demand(10, ServoCommand(*values))
    with pytest.raises(ValueError, match="cannot send"):
        wire.pack_demand(10, ServoCommand(math.inf, *[0.0] * 6))


def test_a_servo_hears_every_frame_whose_low_byte_is_its_id():
    assert wire.heard_by(8) == (0x008, 0x108, 0x208, 0x308, 0x408, 0x508, 0x608, 0x708, 0x8008)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=4))
def test_registers_come_back_integers_clamped(values):
    for resolution in range(4):
        decoded = wire.registers(wire.unpack(wire.pack_reply(resolution, wire.VOLTAGE, tuple(values))))
        assert len(decoded) == len(values)
        assert all(math.isfinite(value) for value in decoded.values())


ANSWER = wire.pack_reply(3, wire.MODE, (10.0, 0.25, 0.5, 1.0)) + wire.pack_reply(
    1, wire.HOME, (2.0, 24.0, 31.0, 0.0)
)


def test_an_answer_to_our_query_is_believed():
    decoded = wire.reply(wire.unpack(wire.padded(ANSWER)))
    assert [decoded[register] for register in range(4)] == [10.0, 0.25, 0.5, 1.0]
    assert [decoded[register] for register in range(0xC, 0x10)] == pytest.approx([2.0, 24.0, 31.0, 0.0])


@pytest.mark.parametrize(
    "answer",
    [
        wire.pack_reply(1, wire.MODE, (10.0,)) + wire.pack_reply(1, wire.FAULT, (0.0,)),
        wire.pack_reply(3, wire.MODE, (10.0, 0.25, 0.5, 1.0)),
        wire.pack_reply(0, wire.MODE, (10.0, 0.25, 0.5, 1.0)) + wire.pack_reply(1, wire.HOME, (2, 24, 31, 0)),
        wire.pack_reply(3, wire.MODE, (10.0, 0.25, 0.5, 1.0)) + wire.pack_reply(0, wire.HOME, (2, 24, 31, 0)),
        wire.pack_reply(3, wire.MODE, (math.nan, 0.25, 0.5, 1.0)) + ANSWER[-11:],
        wire.pack_reply(3, wire.MODE, (10.0, 0.25, math.inf, 1.0)) + ANSWER[-11:],
    ],
    ids=["partial", "half", "coarse position", "coarse state", "no mode", "no speed"],
)
def test_an_answer_to_another_host_tool_is_not_believed(answer):
    assert wire.reply(wire.unpack(wire.padded(answer))) is None
