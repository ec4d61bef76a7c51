"""Whom a frame is for, read from its bytes, against what pymavlink decodes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.message_targets import number_of, target_of

ADDRESSED = {
    kind.msgname: kind
    for kind in mav.mavlink_map.values()
    if {"target_system", "target_component"} <= set(kind.fieldnames)
}


def packed(message, **how):
    return bytes(message.pack(mav.MAVLink(None), **how))


@pytest.mark.parametrize("old", [False, True])
def test_the_target_of_a_frame_is_what_the_foreign_decoder_reads(blank_message, old):
    for number, kind in mav.mavlink_map.items():
        message = blank_message(kind)
        if "target_system" not in kind.fieldnames or (old and number > 255):
            continue
        message.target_system = 7
        if "target_component" in kind.fieldnames:
            message.target_component = 9
        frame = packed(message, force_mavlink1=old)
        assert number_of(frame) == number
        assert target_of(frame) == (7, getattr(message, "target_component", 0)), kind.msgname


@pytest.mark.parametrize("target", [(1, 0), (0, 1), (255, 190), (0, 0)])
def test_any_target_is_read_also_where_its_zeros_are_cut_off(blank_message, target):
    for name, kind in ADDRESSED.items():
        message = blank_message(kind)
        message.target_system, message.target_component = target
        assert target_of(packed(message)) == target, name


def test_what_names_no_target_is_for_all(blank_message):
    for number, kind in mav.mavlink_map.items():
        if "target_system" not in kind.fieldnames and kind.msgname != "TEST_TYPES":
            frame = packed(blank_message(kind))
            assert (number_of(frame), target_of(frame)) == (number, (0, 0)), kind.msgname


@given(st.integers(0, 0xFFFFFF))
def test_a_number_of_three_bytes_is_read_low_byte_first(number):
    """A message that the dialect lacks is for all."""
    frame = bytes([0xFD, 4, 0, 0, 0, 255, 190]) + number.to_bytes(3, "little") + bytes([7, 7, 7, 7, 0, 0])
    assert number_of(frame) == number
    if number not in mav.mavlink_map:
        assert target_of(frame) == (0, 0)


def test_zeros_that_are_not_sent_are_zeros():
    command = mav.MAVLink_command_long_message(1, 1, 0, 0, *([0.0] * 7))
    assert target_of(packed(command)) == (1, 1)
    assert target_of(packed(mav.MAVLink_param_request_list_message(0, 0))) == (0, 0)


def test_the_checksum_behind_a_short_payload_is_no_target():
    for name, kind in ADDRESSED.items():
        frame = bytes([0xFD, 1, 0, 0, 0, 255, 190]) + kind.id.to_bytes(3, "little") + bytes([0, 0xAB, 0xCD])
        assert target_of(frame) == (0, 0), name
