"""A controller in its cycles, over drives whose reports a test gives."""

import math

import msgspec

from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.control import controller as module
from fleet_quadruped.control.controller import Controller
from fleet_quadruped.control.orders import Activity, LoopTiming, Order
from fleet_quadruped.drives.base import JointFeedback, JointsFeedback, Power
from fleet_quadruped.sim.lockstep import SimBus

START = 500.0  # monotonic s


class GivenDrives:
    """Twelve drives that do at once what they are told; ``calls``: how they were written to."""

    addresses = frozenset({("a", 0x201)})

    def __init__(self, posture):
        self.reports = [JointFeedback(angle=angle) for angle in posture]
        self.calls, self.taken = [], []
        self.stubborn = ""
        self.blocked = set()  # joints that do not turn

    def report(self, *numbers, **changes):
        for number in numbers or range(12):
            self.reports[number] = self.reports[number]._replace(**changes)

    def feedback(self, now):
        return JointsFeedback.of(self.reports)

    def handle_frame(self, bus, frame, now):
        self.taken.append((bus, frame.id))

    def begin_cycle(self, now):
        self.calls.append("begin")

    def configure(self):
        self.calls.append("configure")

    def complete(self):
        return True

    def braking(self):
        return self.stubborn

    def probe(self, kd):
        self.calls.append("probe")
        return True

    def enable(self):
        self._are("enable", Power.ENABLED)

    def disable(self):
        self._are("disable", Power.DISABLED)

    def damp(self, kd):
        self.calls.append(("damp", kd))

    def reset_fault(self):
        self._are("reset", Power.DISABLED)
        self.report(fault="")

    def write(self, targets):
        self.calls.append("write")
        for number, angle in enumerate(targets.angles):
            if number in self.blocked:
                continue
            self.report(number, angle=angle, speed=targets.speeds[number])

    def lower(self, targets, kd):
        self.calls.append("lower")

    def _are(self, call, power):
        self.calls.append(call)
        for number, report in enumerate(self.reports):
            if report.power is not Power.ABSENT and report.age < math.inf:
                self.report(number, power=power)


class Bench:
    """A controller in its cycles; ``order`` is kept fresh while ``alive``."""

    def __init__(self, dog, monkeypatch):
        quick = {
            "poses": dog.poses.model_copy(update={"rise_time": 0.3}),
            "safety": dog.safety.model_copy(update={"abandoned": 2.0}),
        }
        self.dog = dog.model_copy(update={"imu": None, "battery": None} | quick)
        self.drives = GivenDrives(dog.posture(dog.poses.fold))
        monkeypatch.setattr(module, "drives_of", lambda dog, buses: self.drives)
        self.bus = SimBus("a")
        self.bus.connect(self)
        self.controller = Controller(self.dog, {"a": self.bus})
        self.order, self.alive, self.now = Order(), True, START

    def handle_frame(self, bus, frame):
        """Take a frame that the controller sends itself."""

    def cycle(self, cycles=1):
        """Run some cycles; return what the drives were told."""
        self.drives.calls.clear()
        for _ in range(cycles):
            if self.alive:
                self.order = msgspec.structs.replace(self.order, alive=self.now)
            self.controller.begin(self.now)
            self.controller.finish(self.now, self.dog.dt, self.order)
            self.now += self.dog.dt
        return [call for call in self.drives.calls if call != "begin"]

    def tell(self, **changes):
        self.order = msgspec.structs.replace(self.order, **changes)

    def request(self, request, value=0.0):
        self.tell(activity=Activity(self.order.activity.number + 1, request, value))
        self.cycle()
        return self.state().refusal

    def state(self):
        return self.controller.state(self.now, LoopTiming())

    def stand(self):
        self.drives.report(age=0.0, power=Power.DISABLED)
        self.cycle(2)
        assert self.request(BodyRequest.STAND) == ""
        while self.state().mode != "standing":
            assert self.cycle() != ["disable"]
        return self
