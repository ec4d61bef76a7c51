"""The object dictionary of a simulated node: read and written by SDO, refused as CiA 301 does."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import CanFrame
from fleet_quadruped.sim.sdo import NO_OBJECT, NOT_MAPPABLE, READ_ONLY, TOO_LONG, SdoServer

OBJECTS = {
    (0x1000, 0): (4, 0x20192),
    (0x6060, 0): (1, 0),
    (0x6065, 0): (2, 500),
    (0x1016, 1): (4, 0),
    (0x1600, 0): (1, 0),
    (0x1600, 1): (4, 0),
    (0x1400, 1): (4, 1 << 31 | 0x207),
}
PDO_NOT_OFF = 0x08000022


class Node:
    """A node 7, and its answers."""

    def __init__(self):
        self.answers = []
        self.server = SdoServer(7, OBJECTS, self.answers.append)

    def say(self, data, identifier=0x607):
        self.server.handle_frame(CanFrame(identifier, data))
        answer = self.answers.pop() if self.answers else None
        assert self.answers == []
        return answer

    def read(self, index, sub=0):
        answer = self.say(struct.pack("<BHB4x", 0x40, index, sub))
        assert answer.id == 0x587
        return answer.data

    def write(self, index, sub, size, value):
        head = struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub)
        return self.say(head + value.to_bytes(size, "little").ljust(4, b"\0")).data


@pytest.fixture
def node():
    return Node()


def abort(data):
    """Return the code of an abort; None for another answer."""
    return struct.unpack("<I", data[4:])[0] if data[0] == 0x80 else None


@pytest.mark.parametrize(
    ("place", "command", "value"),
    [((0x1000, 0), 0x43, 0x20192), ((0x6065, 0), 0x4B, 500), ((0x6060, 0), 0x4F, 0)],
)
def test_an_object_is_read_with_its_size(node, place, command, value):
    assert node.read(*place) == struct.pack("<BHBI", command, *place, value)


@given(st.integers(0, 0xFFFF))
def test_what_is_written_is_read_again(value):
    node = Node()
    node.server.changed = False
    assert node.write(0x6065, 0, 2, value) == struct.pack("<BHB4x", 0x60, 0x6065, 0)
    assert node.server.changed
    assert node.read(0x6065)[4:] == struct.pack("<I", value)


def test_an_object_that_is_not_there_is_neither_read_nor_written(node):
    assert abort(node.read(0x2000)) == NO_OBJECT
    assert abort(node.read(0x1016, 2)) == NO_OBJECT
    assert abort(node.write(0x2000, 0, 4, 1)) == NO_OBJECT


@pytest.mark.parametrize("size", [1, 3, 4])
def test_a_value_of_another_size_is_not_written(node, size):
    assert abort(node.write(0x6065, 0, size, 1)) == TOO_LONG
    assert node.server.objects[0x6065, 0].value == 500


def test_what_a_node_is_cannot_be_written(node):
    node.server.changed = False
    assert abort(node.write(0x1000, 0, 4, 1)) == READ_ONLY
    assert not node.server.changed


def test_a_refused_object_has_the_code_of_its_refusal(node):
    node.server.refusals[0x6060, 0] = 0x08000020
    assert abort(node.write(0x6060, 0, 1, 8)) == 0x08000020


def test_a_mapping_is_written_while_its_pdo_is_off_and_empty(node):
    assert abort(node.write(0x1600, 1, 4, 0x60400010)) is None
    assert abort(node.write(0x1600, 0, 1, 1)) is None
    assert abort(node.write(0x1600, 1, 4, 0x607A0020)) == PDO_NOT_OFF
    node.write(0x1600, 0, 1, 0)
    node.write(0x1400, 1, 4, 0x207)
    assert abort(node.write(0x1600, 1, 4, 0x607A0020)) == PDO_NOT_OFF


def test_what_cannot_be_mapped_is_refused(node):
    node.server.unmappable = frozenset({0x60B20010})
    assert abort(node.write(0x1600, 1, 4, 0x60B20010)) == NOT_MAPPABLE
    assert abort(node.write(0x1600, 1, 4, 0x60400010)) is None


@pytest.mark.parametrize("command", [0x00, 0x21, 0x60, 0xA0])
def test_a_segmented_or_unknown_request_is_aborted(node, command):
    assert abort(node.say(struct.pack("<BHB4x", command, 0x6065, 0)).data) == 0x05040001


def test_an_abort_of_ours_is_not_answered(node):
    assert node.say(struct.pack("<BHBI", 0x80, 0x6065, 0, 0x05040000)) is None


@pytest.mark.parametrize(("identifier", "size"), [(0x608, 8), (0x587, 8), (0x607, 7)])
def test_what_is_no_request_to_this_node_is_ignored(node, identifier, size):
    assert node.say(struct.pack("<BHB4x", 0x40, 0x6065, 0)[:size], identifier) is None
