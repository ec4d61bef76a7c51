"""A simulated machine that walks by itself as a CANopen node: configured, started, and read by SYNC."""

import math
import struct

import pytest

from fleet import CanFrame
from fleet_quadruped.any_description import load_body
from fleet_quadruped.drives.cia402.frames import SYNC
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.safety.stages import BodyMode
from tests.adapters.fleet_quadruped.sim.walker_benches import Bench

CANOPEN = load_body(EXAMPLE.with_name("self-walking-canopen.yaml"))
NODE = 9


class Node(Bench):
    """The machine as a CANopen node."""

    def __init__(self):
        super().__init__(CANOPEN)

    def configure(self):
        for item in self.wire.setup:
            (answer,) = self.sdo(
                0x23 | (4 - item.size) << 2,
                item.place,
                item.sub,
                item.value.to_bytes(item.size, "little").ljust(4, b"\0"),
            )
            assert answer[0] == 0x60, item
        return self

    def start(self, command=1):
        return self.send(CanFrame(0x000, bytes([command, NODE])))

    def sdo(self, command, index, sub, data=bytes(4)):
        self.heard.clear()
        self.send(CanFrame(0x600 + NODE, struct.pack("<BHB", command, index, sub) + data))
        return [frame.data for frame in self.heard if frame.id == 0x580 + NODE]


@pytest.fixture
def node():
    return Node()


def test_a_node_boots_up_and_walks_once_it_is_configured_and_started(node):
    assert node.heard == [CanFrame(0x709, b"\x00")]
    node.start().stand().drive(0.5, seconds=0.5)
    assert node.machine.twist.x == 0.0  # its PDOs are not mapped
    node.configure().start().drive(0.5, seconds=0.5)
    assert node.machine.twist.x > 0.4
    node.start(0x80).drive(0.5, seconds=1.0)
    assert abs(node.machine.twist.x) < 0.01


def test_a_node_says_its_state_with_each_sync_and_the_rest_with_every_tenth(node):
    node.configure().start().heard.clear()
    assert node.go(1.0).heard == []
    for _ in range(10):
        node.send(CanFrame(SYNC, b""))
    ids = [frame.id for frame in node.heard]
    assert [ids.count(frame.id) for frame in (*CANOPEN.wire.state, *CANOPEN.wire.slow)] == [10, 10, 10, 1]


def test_a_node_that_is_not_started_says_nothing(node):
    node.configure().heard.clear()
    assert node.send(CanFrame(SYNC, b"")).heard == []
    assert node.send(CanFrame(0x000, b"\x01\x08"), CanFrame(SYNC, b"")).heard == []  # another node's


def test_a_command_of_a_node_is_a_write_that_is_answered(node):
    node.configure().heard.clear()
    assert node.command("stand_up").mode is BodyMode.RISING
    assert [frame.data[:4].hex() for frame in node.heard] == ["60002200"]


def test_a_height_of_a_node_is_written_in_its_unit(node):
    node.configure()
    assert node.machine.height == CANOPEN.height
    assert node.send(CANOPEN.wire.height(0.25)).machine.height == pytest.approx(0.25)


def test_a_node_that_tips_says_so(node):
    node.configure().start().machine.fault("tip", 0.5)
    node.send(CanFrame(SYNC, b""))
    said = node.said()
    assert (said["qw"], said["qx"]) == pytest.approx((math.cos(0.25), math.sin(0.25)), abs=1e-3)
