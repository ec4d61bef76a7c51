"""The file server of a simulated autopilot is as strict as PX4's: one session, and no repeats."""

import struct
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mav

from fleet_mavlink.sim.files import SimFiles

HEAD = struct.Struct("<HBBBBBxI")
ACK, NAK = 128, 129
TERMINATE, RESET, OPEN, READ, WRITE, CRC = 1, 2, 4, 5, 7, 14
PATH, DATA = "etc/it", bytes(range(250)) * 2


class Client:
    """A station at 245/191 that numbers its requests; ``asks`` gives the code and the data of the answer."""

    def __init__(self):
        self.files = SimFiles({PATH: DATA})
        self.sequence = 0

    def send(self, opcode, data=b"", *, offset=0, size=None, session=0, sequence=None):
        if sequence is None:
            sequence = self.sequence = (self.sequence + 2) & 0xFFFF
        head = HEAD.pack(sequence, session, opcode, len(data) if size is None else size, 0, 0, offset)
        message = mav.MAVLink_file_transfer_protocol_message(0, 1, 1, list((head + data).ljust(251, b"\0")))
        message._header.srcSystem, message._header.srcComponent = 245, 191
        (answer,) = self.files.requested(message)
        return answer

    def asks(self, opcode, data=b"", **more):
        said = bytes(self.send(opcode, data, **more).payload)
        _, _, code, size, of, _, _ = HEAD.unpack_from(said)
        assert of == opcode
        return code, said[12 : 12 + size]


@pytest.fixture
def it():
    return Client()


@pytest.fixture
def opened(it):
    assert it.asks(OPEN, PATH.encode()) == (ACK, len(DATA).to_bytes(4, "little"))
    return it


def test_an_answer_has_the_next_number_and_goes_to_who_asked(it):
    answer = it.send(CRC, PATH.encode(), sequence=0xFFFF)
    assert (answer.target_system, answer.target_component, len(answer.payload)) == (245, 191, 251)
    assert HEAD.unpack_from(bytes(answer.payload))[0] == 0


@pytest.mark.parametrize("path", [PATH.encode(), PATH.encode() + b"\0rest"])
def test_a_checksum_needs_no_session(it, path):
    assert it.asks(CRC, path) == (ACK, zlib.crc32(DATA).to_bytes(4, "little"))


@pytest.mark.parametrize("opcode", [OPEN, CRC])
def test_a_file_that_is_not_there_is_error_10(it, opcode):
    assert it.asks(opcode, b"etc/other") == (NAK, bytes([10]))
    assert it.asks(opcode, b"\xff\xfe") == (NAK, bytes([10]))


@given(st.integers(0, len(DATA) - 1), st.integers(0, 255))
def test_a_piece_is_as_long_as_fits_whatever_was_asked_for(offset, size):
    it = Client()
    it.asks(OPEN, PATH.encode())
    assert it.asks(READ, offset=offset, size=size) == (ACK, DATA[offset : offset + 239])


def test_beyond_the_end_is_error_6(opened):
    assert opened.asks(READ, offset=len(DATA)) == (NAK, bytes([6]))


def test_without_a_session_nothing_is_read_or_closed(it):
    assert it.asks(READ) == (NAK, bytes([4]))
    assert it.asks(TERMINATE) == (NAK, bytes([4]))


def test_another_session_than_the_one_is_error_4(opened):
    assert opened.asks(READ, session=1) == (NAK, bytes([4]))
    assert opened.asks(TERMINATE, session=1) == (NAK, bytes([4]))


def test_a_second_file_is_not_opened_before_the_first_is_closed(opened):
    assert opened.asks(OPEN, PATH.encode()) == (NAK, bytes([5]))
    assert opened.asks(TERMINATE) == (ACK, b"")
    assert opened.asks(OPEN, PATH.encode())[0] == ACK


@pytest.mark.parametrize("ends", [lambda it: it.asks(RESET), lambda it: it.files.reboot()])
def test_a_session_ends_by_a_reset_and_by_a_restart(opened, ends):
    ends(opened)
    assert opened.asks(OPEN, PATH.encode())[0] == ACK


def test_a_request_with_the_last_number_is_a_repeat_and_gets_the_same_answer(opened):
    first = opened.send(CRC, PATH.encode())
    again = opened.send(TERMINATE, sequence=opened.sequence)
    assert again.payload == first.payload
    assert opened.asks(READ)[0] == ACK  # the session was not closed


def test_a_long_answer_is_not_kept_and_its_number_is_good_for_another_request(opened):
    opened.send(READ)
    assert opened.asks(TERMINATE, sequence=opened.sequence) == (ACK, b"")


@pytest.mark.parametrize("opcode", [0, 3, WRITE, 15, 99])
def test_nothing_else_is_served(it, opcode):
    assert it.asks(opcode, PATH.encode()) == (NAK, bytes([7]))
