from collections import Counter

import pytest

from fleet_quadruped.robot.busload import bus_loads, frame_bits
from fleet_quadruped.robot.parts import CanBusConfig, Drive


def test_a_full_frame_with_worst_stuffing_takes_135_bits():
    assert frame_bits(8) == 135
    assert frame_bits(8, extended=True) == 160


@pytest.mark.parametrize(("protocol", "load"), [("mit", 0.324), ("cia402", 0.37), ("odrive", 0.53)])
def test_twelve_drives_at_100_cycles_take_their_share_of_a_megabit(protocol, load):
    loads = bus_loads(Drive(protocol=protocol), Counter(a=12), [], {"a": CanBusConfig()})
    assert loads["a"] == pytest.approx(load, abs=0.01)


def test_half_the_drives_take_half_the_bus():
    drive = Drive(protocol="mit")
    whole = bus_loads(drive, Counter(a=12), [], {"a": CanBusConfig()})["a"]
    halves = bus_loads(drive, Counter(a=6, b=6), [], {"a": CanBusConfig(), "b": CanBusConfig()})
    assert halves == {"a": whole / 2, "b": whole / 2}


def test_servos_on_can_fd_take_a_quarter_of_their_bus():
    loads = bus_loads(
        Drive(protocol="moteus"), Counter(a=12), [], {"a": CanBusConfig(data_bitrate=5_000_000)}
    )
    assert loads["a"] == pytest.approx(0.37, abs=0.02)
