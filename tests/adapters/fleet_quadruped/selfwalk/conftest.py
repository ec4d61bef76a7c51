import msgspec
import pytest

from fleet_quadruped.any_description import load_body
from fleet_quadruped.body.gait import Twist
from fleet_quadruped.control.orders import Activity, LoopTiming, Order
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.selfwalk.controller import SelfWalkController
from fleet_quadruped.sim.simulated_machine import on_buses


class WalkerRig:
    """A simulated machine and its controller in one time."""

    def __init__(self, walker, real=None):
        self.walker = walker
        self.machine, buses = on_buses(real or walker, "auto")
        self.bus = buses["a"]
        self.controller = SelfWalkController(walker, buses)
        self.controller.configure()
        self.order = Order()
        self.alive = True

    @property
    def state(self):
        return self.controller.state(self.machine.time, LoopTiming())

    def cycle(self):
        now, dt = self.machine.time, self.walker.dt
        self.controller.begin(now)
        for frame in self.bus.receive(0.0):
            self.controller.handle_frame("a", frame, now)
        if self.alive:
            self.order = msgspec.structs.replace(self.order, until=now + 1.0, alive=now)
        self.controller.finish(now, dt, self.order)
        self.machine.advance(dt)

    def go(self, seconds, twist=Twist()):  # noqa: B008
        self.order = msgspec.structs.replace(self.order, x=twist.x, y=twist.y, turn=twist.turn)
        for _ in range(round(seconds / self.walker.dt)):
            self.cycle()

    def request(self, request, value=0.0):
        """Ask for something and wait for the answer; return the refusal."""
        number = self.order.activity.number + 1
        self.order = msgspec.structs.replace(self.order, activity=Activity(number, request, value))
        for _ in range(200):
            self.cycle()
            if self.state.answered == number:
                return self.state.refusal
        raise AssertionError("never answered")

    def emergency(self):
        self.order = msgspec.structs.replace(self.order, stop=self.order.stop + 1)


@pytest.fixture(scope="session", params=["self-walking", "self-walking-canopen"])
def walker(request):
    return load_body(EXAMPLE.with_name(f"{request.param}.yaml"))


@pytest.fixture
def walker_rig(walker):
    return WalkerRig(walker)


@pytest.fixture
def make_walker_rig():
    return WalkerRig
