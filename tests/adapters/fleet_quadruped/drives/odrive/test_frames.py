import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet_quadruped.drives.odrive import frames as wire
from fleet_quadruped.drives.odrive.frames import OdriveCommand, State

numbers = st.floats(-1e4, 1e4)


def test_the_identifier_is_the_node_and_the_command():
    assert wire.identifier(1, OdriveCommand.INPUT_POS) == 0x2C  # the example of the protocol's document
    assert wire.split(0x2C) == (1, OdriveCommand.INPUT_POS)


def test_golden_frames():
    assert wire.pack_input(math.tau, 0.5 * math.tau, -0.25).hex() == "0000803ff40106ff"
    assert wire.pack_state(State.CLOSED_LOOP).hex() == "08000000"
    assert wire.pack_modes().hex() == "0300000001000000"
    assert wire.pack_gain(20.0).hex() == "0000a041"
    assert wire.request(3, OdriveCommand.ESTIMATES).id == 0x69
    assert wire.request(3, OdriveCommand.ESTIMATES).remote
    assert wire.write_parameter(241, b"\x01").hex() == "01f1000001"
    assert wire.read_parameter(241).hex() == "00f10000"


def test_a_golden_heartbeat():
    assert wire.unpack_heartbeat(bytes.fromhex("0000000108000000")) == (0x01000000, State.CLOSED_LOOP)
    assert wire.words(0x01000000) == "our frames did not reach the drive"
    assert wire.words(0x80000600) == "under-voltage, over-current, error 80000000h"


@given(numbers, st.floats(-1e9, 1e9), st.floats(-1e9, 1e9))
def test_a_position_comes_back_and_what_is_fed_forward_is_clamped(angle, speed, torque):
    unpacked = wire.unpack_input(wire.pack_input(angle, speed, torque))
    assert unpacked[0] == pytest.approx(angle, abs=1e-3)
    assert unpacked[1] == pytest.approx(max(-32.767, min(32.767, speed / math.tau)) * math.tau, abs=0.01)
    assert unpacked[2] == pytest.approx(max(-32.767, min(32.767, torque)), abs=1e-3)


@pytest.mark.parametrize("numbers", [(math.nan, 0, 0), (0, math.inf, 0), (0, 0, math.nan)])
def test_what_is_no_number_is_not_sent(numbers):
    with pytest.raises(ValueError, match="cannot send"):
        wire.pack_input(*numbers)


@given(st.binary(max_size=12))
def test_no_frame_breaks_the_decoders(data):
    for unpack in (wire.unpack_heartbeat, wire.unpack_pair, wire.unpack_version, wire.unpack_parameter):
        unpack(data)
    wire.unpack_input(data)
    wire.warmest(data)


def test_a_motor_without_a_thermistor_has_the_temperature_of_its_transistors():
    assert wire.warmest(wire.pack_pair(41.5, math.nan)) == 41.5


@given(st.floats(0, 500), st.floats(0.01, 5))
def test_gains_are_a_spring_and_a_damper(kp, kd):
    position, velocity = wire.gains(kp, kd)
    assert position * velocity == pytest.approx(kp * math.tau)  # N m/turn
    assert velocity == pytest.approx(kd * math.tau)
