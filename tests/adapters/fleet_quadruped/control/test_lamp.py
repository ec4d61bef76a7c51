"""The lamp of a robot: a frame for each change, and none without one."""

import pytest

from fleet import CanFrame
from fleet_quadruped.control.lamp import Lamp
from fleet_quadruped.robot.parts import Switch

LED = Switch(bus="b", id=0x121, on="01FF", off="00")
ON, OFF = CanFrame(0x121, b"\x01\xff"), CanFrame(0x121, b"\x00")


class Bus(list):
    """A bus that keeps what is sent."""

    send = list.append


@pytest.fixture
def buses():
    return {"a": Bus(), "b": Bus()}


def shown(buses, led, *states):
    lamp = Lamp(led, buses)
    for state in states:
        lamp.show(state)
    return buses["b"]


@pytest.mark.parametrize(
    ("states", "sent"),
    [
        ([True], [ON]),
        ([False], [OFF]),
        ([True, True, True], [ON]),
        ([True, False, False, True], [ON, OFF, ON]),
        ([None, None], []),
        ([True, None, True, None, False], [ON, OFF]),
    ],
)
def test_only_a_change_is_sent_and_it_is_sent_on_the_lamps_bus(buses, states, sent):
    assert shown(buses, LED, *states) == sent
    assert buses["a"] == []


def test_a_robot_without_a_lamp_sends_nothing(buses):
    assert shown(buses, None, True, False, True) == []
