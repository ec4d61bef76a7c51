"""Buses of a simulated robot in this process: frames both ways, a cut wire, and a robot in one time."""

import threading

import pytest

from fleet import CanFrame
from fleet.errors import LinkLost
from fleet_quadruped.drives.cia402.frames import SYNC
from fleet_quadruped.sim.lockstep import SimBus, lockstep
from fleet_quadruped.sim.world import KinematicWorld

FRAME = CanFrame(0x201, b"\x01")


class Robot:
    """A robot that keeps what it is sent, and answers on the bus at once if it is ``polite``."""

    def __init__(self, bus=None):
        self.taken, self._bus = [], bus

    def handle_frame(self, bus, frame):
        self.taken.append((bus, frame))
        if self._bus is not None:
            self._bus.arrive(CanFrame(frame.id + 1, frame.data))


@pytest.fixture
def bus():
    return SimBus("a")


def test_a_frame_reaches_the_robot_at_once_with_the_name_of_its_bus(bus):
    robot = Robot()
    bus.connect(robot)
    bus.send(FRAME)
    assert robot.taken == [("a", FRAME)]
    assert list(bus.sent) == [FRAME]


def test_answers_are_received_once_and_in_their_order(bus):
    bus.connect(Robot(bus))
    bus.send(FRAME)
    bus.arrive(CanFrame(0x300, b""))
    assert bus.receive(0.0) == [CanFrame(0x202, b"\x01"), CanFrame(0x300, b"")]
    assert bus.receive(0.0) == []


def test_only_the_newest_frames_that_were_sent_are_kept(bus):
    bus.connect(Robot())
    for number in range(100):
        bus.send(CanFrame(number, b""))
    assert [frame.id for frame in bus.sent] == list(range(36, 100))


def test_a_bus_that_is_cut_carries_nothing_and_says_so(bus):
    robot = Robot()
    bus.connect(robot)
    bus.arrive(FRAME)
    bus.cut = True
    bus.send(FRAME)
    bus.arrive(FRAME)
    assert (robot.taken, list(bus.sent)) == ([], [])
    with pytest.raises(LinkLost, match="bus 'a' is gone"):
        bus.receive(0.0)
    bus.cut = False
    assert bus.receive(0.0) == [FRAME]


def test_a_closed_bus_has_no_robot_any_more(bus):
    robot = Robot()
    bus.connect(robot)
    bus.close()
    bus.send(FRAME)
    assert robot.taken == []


def test_an_answer_to_another_thread_ends_a_wait(bus):
    received = []
    waiting = threading.Thread(target=lambda: received.append(bus.receive(30.0)))
    waiting.start()
    while bus._wakeup is None:
        pass
    bus.arrive(FRAME)
    waiting.join(10.0)
    assert received == [[FRAME]]


def test_a_frame_that_is_there_already_is_not_waited_for(bus, monkeypatch):
    bus.arrive(FRAME)
    monkeypatch.setattr(threading.Event, "wait", lambda event, seconds: pytest.fail("it waits"))
    assert bus.receive(30.0) == [FRAME]


def test_a_dog_is_on_the_buses_of_its_description(dog):
    sim, buses = lockstep(dog)
    assert list(buses) == ["a"]
    assert isinstance(sim.world, KinematicWorld)
    assert {frame.id for frame in buses["a"].receive(0.0)} == {0x700 + number for number in range(1, 13)}
    for number in range(1, 13):
        buses["a"].send(CanFrame(0x000, bytes([1, number])))
    buses["a"].send(CanFrame(SYNC, b""))
    assert len(buses["a"].receive(0.0)) == 12


def test_a_dog_may_be_built_otherwise_than_it_is_described(dog, mit_dog):
    world = KinematicWorld(dog)
    sim, _ = lockstep(dog, world, real=mit_dog)
    assert (sim.dog, sim.world) == (mit_dog, world)


def test_the_seed_decides_what_is_lost(dog):
    def heard(seed):
        sim, buses = lockstep(dog, seed=seed)
        sim.fault("loss", 0.5)
        for _ in range(5):
            sim.advance(0.01)
        return [frame.id for frame in buses["a"].receive(0.0)]

    assert heard(3) == heard(3)
    assert heard(3) != heard(4)
