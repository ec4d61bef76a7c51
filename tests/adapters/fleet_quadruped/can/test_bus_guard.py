"""Nobody speaks to drives to which somebody else speaks."""

import pytest

from fleet.clock import SystemClock
from fleet.errors import LinkLost
from fleet.link.canbus.bus import OpenCanBus
from fleet.link.canbus.frame import CanFrame
from fleet.testing.clock import ManualClock
from fleet_quadruped.any_description import load_body
from fleet_quadruped.bench_tools import BenchSession, listen, scan
from fleet_quadruped.can.bus_guard import LISTEN, require_sole_controller
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.lockstep import SimBus
from tests.adapters.fleet_quadruped.copies import walking_dog

OTHER = r"^bus 'a': another controller commands the drives \(frame \w+h\); only one may"


class Shared:
    """The bus of a walking dog as a second program has it: it hears what the first one sends."""

    def __init__(self, rig, clock):
        self.name, self._rig, self._clock = "a", rig, clock
        self.said = []
        self.send = self.said.append

    def receive(self, _wait):
        self._clock.advance(self._rig.dog.dt)
        self._rig.buses["a"].sent.clear()
        self._rig.cycle()
        return list(self._rig.buses["a"].sent)


@pytest.fixture
def walking(any_dog):
    return walking_dog(any_dog)


@pytest.mark.parametrize("tool", [lambda dog, bus, clock: BenchSession(dog, {"a": bus}, clock), None])
def test_a_tool_says_nothing_to_a_dog_that_somebody_drives(walking, tool):
    if tool is None and walking.dog.drive.protocol == "odrive":
        return  # CANopen nodes speak with the same frames: see "The first time" in docs/how-to/quadruped.md
    clock = ManualClock()
    bus = Shared(walking, clock)
    with pytest.raises(LinkLost, match=OTHER):
        tool(walking.dog, bus, clock) if tool else scan(bus, clock)
    assert bus.said == []
    assert walking.mode is BodyMode.WALKING


def test_nor_to_one_that_rests_under_another_controller(rig):
    clock = ManualClock()
    with pytest.raises(LinkLost, match=OTHER):
        require_sole_controller({"a": Shared(rig, clock)}, rig.controller.addresses, clock)


def test_nor_to_a_machine_that_walks_by_itself():
    walker = load_body(EXAMPLE.with_name("self-walking.yaml"))
    bus = SimBus("a")
    bus.arrive(CanFrame(walker.wire.velocity[0].id, bytes(6)))
    with pytest.raises(LinkLost, match=OTHER):
        listen(walker, {"a": bus}, SystemClock())


def test_what_the_drives_themselves_say_is_no_other_controller(rig):
    clock = ManualClock()

    class Heard:
        def receive(self, _wait):
            clock.advance(0.02)
            rig.sim.advance(0.02)
            return rig.buses["a"].receive(0.0)

    require_sole_controller({"a": Heard()}, rig.controller.addresses, clock)
    assert clock.monotonic() >= LISTEN


def test_two_programs_on_one_bus_hear_each_other():
    clock = SystemClock()
    one, other = (OpenCanBus("a", "can:virtual:alone", 1_000_000, clock) for _ in range(2))
    try:
        one.send(CanFrame(0x201, bytes(8)))
        with pytest.raises(LinkLost, match=OTHER):
            require_sole_controller({"a": other}, {("a", 0x201)}, clock)
    finally:
        one.close()
        other.close()
