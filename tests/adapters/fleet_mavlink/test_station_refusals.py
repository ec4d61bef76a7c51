"""How a ground station is refused, by the means of each protocol."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.messages import StatusTextMessage
from fleet_mavlink.station_refusals import refusal, unchanged, words
from fleet_mavlink.statustext import StatusTextAssembler

ARM = mav.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
FTP = struct.Struct("<HBBBBBxI")


def from_station(message, system=255, component=190):
    """Return a message as it is decoded from the wire."""
    sender = mav.MAVLink(None, srcSystem=system, srcComponent=component)
    return mav.MAVLink(None).decode(bytearray(message.pack(sender)))


def file_message(opcode, sequence=7):
    payload = FTP.pack(sequence, 3, opcode, 0, 0, 0, 0).ljust(251, b"\0")
    return mav.MAVLink_file_transfer_protocol_message(0, 1, 1, list(payload))


def addressee(answer):
    return answer.target_system, answer.target_component


def test_commands_are_denied_to_who_asked():
    answer = refusal(from_station(ARM, 254, 1))
    assert (answer.command, answer.result) == (400, mav.MAV_RESULT_DENIED)
    assert addressee(answer) == (254, 1)
    place = mav.MAVLink_command_int_message(1, 1, 6, 192, 0, 0, -1, 1, 0, 0, 0, 0, 0)
    assert (refusal(from_station(place)).command, refusal(from_station(place)).result) == (192, 2)


def test_a_change_of_mode_is_denied_as_the_command_that_does_the_same():
    answer = refusal(from_station(mav.MAVLink_set_mode_message(1, 1, 4)))
    assert (answer.command, answer.result) == (mav.MAV_CMD_DO_SET_MODE, mav.MAV_RESULT_DENIED)
    assert addressee(answer) == (255, 190)


@pytest.mark.parametrize("kind", [0, 1, 2])
def test_plans_are_denied_by_their_kind(kind):
    for message in (
        mav.MAVLink_mission_count_message(1, 1, 4, kind),
        mav.MAVLink_mission_clear_all_message(1, 1, kind),
        mav.MAVLink_mission_write_partial_list_message(1, 1, 0, 3, kind),
        mav.MAVLink_mission_item_message(1, 1, 0, 3, 16, 0, 1, 0, 0, 0, 0, 0, 0, 0, kind),
        mav.MAVLink_mission_item_int_message(1, 1, 0, 3, 16, 0, 1, 0, 0, 0, 0, 0, 0, 0, kind),
    ):
        answer = refusal(from_station(message))
        assert (answer.type, answer.mission_type) == (mav.MAV_MISSION_DENIED, kind)
        assert addressee(answer) == (255, 190)


def test_a_parameter_is_denied_and_its_value_is_reported_again():
    message = from_station(mav.MAVLink_param_set_message(1, 1, b"RTL_ALT", 5.0, 9))
    answer = refusal(message)
    assert (answer.get_type(), answer.error, answer.param_id) == ("PARAM_ERROR", 3, "RTL_ALT")
    assert (answer.param_index, *addressee(answer)) == (-1, 255, 190)
    again = unchanged(message)
    assert (again.get_type(), again.param_id, again.param_index) == ("PARAM_REQUEST_READ", "RTL_ALT", -1)
    assert addressee(again) == (1, 1)


def test_only_a_parameter_is_reported_again():
    assert unchanged(from_station(ARM)) is None
    assert unchanged(from_station(mav.MAVLink_param_request_read_message(1, 1, b"RTL_ALT", -1))) is None


def test_a_long_parameter_fails_with_the_value_that_was_meant():
    message = mav.MAVLink_param_ext_set_message(1, 100, b"CAM_MODE", b"3", 4)
    answer = refusal(from_station(message))
    assert answer.get_type() == "PARAM_EXT_ACK"
    assert (answer.param_id, answer.param_value, answer.param_type) == ("CAM_MODE", "3", 4)
    assert answer.param_result == mav.PARAM_ACK_FAILED


def test_the_writing_of_a_file_is_refused_as_protected():
    answer = refusal(from_station(file_message(7)))
    assert FTP.unpack_from(bytes(answer.payload)) == (8, 3, 129, 1, 7, 0, 0)
    assert answer.payload[12] == 9
    assert (len(answer.payload), *addressee(answer)) == (251, 255, 190)


def test_the_sequence_of_a_file_transfer_begins_again_after_its_last_number():
    answer = refusal(from_station(file_message(7, sequence=0xFFFF)))
    assert FTP.unpack_from(bytes(answer.payload))[0] == 0


@pytest.mark.parametrize(
    "message",
    [
        mav.MAVLink_mission_set_current_message(1, 1, 0),
        mav.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0),
        mav.MAVLink_setup_signing_message(1, 1, [0] * 32, 0),
    ],
    ids=lambda message: message.get_type(),
)
def test_what_no_protocol_refuses_is_not_answered(message):
    assert refusal(from_station(message)) is None


def test_every_answer_can_be_framed(blank_message):
    sender = mav.MAVLink(None)
    for kind in mav.mavlink_map.values():
        message = blank_message(kind)
        if message.get_type() != "TEST_TYPES" and (answer := refusal(from_station(message))) is not None:
            assert answer.pack(sender)


@given(st.integers(1, 300))
def test_words_of_any_length_are_whole_where_they_are_joined(length):
    text = "".join(chr(33 + each % 90) for each in range(length))
    joiner, heard = StatusTextAssembler(), []
    pieces = words(text)
    for piece in pieces:
        said = StatusTextMessage(piece.severity, piece.text, piece.id, piece.chunk_seq)
        heard += joiner.feed(said, 0.0)
    heard += joiner.late(2.0)
    assert [(sentence.text, sentence.severity) for sentence in heard] == [(text, 4)]
    assert [piece.chunk_seq for piece in pieces] == list(range(len(pieces)))


def test_only_words_that_need_pieces_have_a_number():
    assert [(piece.id, piece.chunk_seq) for piece in words("x" * 50)] == [(0, 0)]
    assert [(piece.id != 0, len(piece.text)) for piece in words("x" * 51)] == [(True, 50), (True, 1)]
