"""A robot in lock-step with its controller, for tests and tuning; time passes in ``go`` only."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import msgspec

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.control.controller import Controller
from fleet_quadruped.control.orders import Activity, DogState, LoopTiming, Order
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.safety.stages import BodyMode
from fleet_quadruped.sim.lockstep import lockstep
from fleet_quadruped.sim.world import World

_NEAR = 0.1  # rad: largest change of a lowered joint's target in a cycle


class Rig:
    """A simulated robot, configured and off. ``order``: the host's order, kept fresh."""

    def __init__(
        self,
        dog: DogDescription,
        world: World | None = None,
        *,
        real: DogDescription | None = None,
        seed: int = 1,
    ) -> None:
        self.dog = dog
        self.sim, self.buses = lockstep(dog, world, real=real, seed=seed)
        self.order = Order()
        self.controller = Controller(dog, self.buses)
        self.controller.drives.configure()
        self.alive = True
        self.skew = 0.0  # s: offset of the controller's clock
        self.tilt = 0.0  # rad: largest since the start of the last ``go``
        self.watch: Callable[[], None] = lambda: None

    @property
    def mode(self) -> BodyMode:
        """Mode of the body."""
        return self.controller.body.mode

    @property
    def fault(self) -> str:
        """The latched fault."""
        return self.controller.body.fault

    def state(self) -> DogState:
        """Return the controller's state."""
        return self.controller.state(self.sim.time + self.skew, LoopTiming())

    def cycle(self) -> None:
        """Run one control cycle."""
        now, dt = self.sim.time + self.skew, self.dog.dt
        self.controller.begin(now)
        for name, bus in self.buses.items():
            for frame in bus.receive(0.0):
                self.controller.handle_frame(name, frame, now)
        if self.alive:
            self.order = msgspec.structs.replace(self.order, until=now + 1.0, alive=now)
        self.controller.finish(now, dt, self.order)
        self.sim.advance(dt)
        self.tilt = max(self.tilt, self.sim.world.imu().tilt)
        self.watch()

    def is_compliant(self, joints: Iterable[int] = range(12)) -> bool:
        """Return True if joints (by number) damp, or are near the targets of the lowering."""
        targets = self.controller.targets
        motors = ((self.sim.world.motors[number], targets[number]) for number in joints)
        return self.mode is BodyMode.DAMPED and all(
            motor.kd >= 2.9 and (motor.kp == 0 or abs(motor.target - target) < _NEAR)
            for motor, target in motors
        )

    def reconnect(self) -> None:
        """Start a new controller for the same robot, as after a lost link."""
        self.order = Order()
        self.controller = Controller(self.dog, self.buses)
        self.controller.drives.configure()

    def go(self, seconds: float, twist: Twist = Twist(), *, until: BodyMode | None = None) -> None:  # noqa: B008 - immutable
        """Advance with a velocity; end early in the mode ``until``."""
        self.order = msgspec.structs.replace(self.order, x=twist.x, y=twist.y, turn=twist.turn)
        self.tilt = 0.0
        for _ in range(round(seconds / self.dog.dt)):
            self.cycle()
            if self.mode is until:
                break

    def request(self, request: BodyRequest, value: float = 0.0) -> str:
        """Send a request to the body; return the reason of a refusal, empty if it is accepted."""
        self.order = msgspec.structs.replace(
            self.order, activity=Activity(self.order.activity.number + 1, request, value)
        )
        self.cycle()
        return self.state().refusal

    def emergency(self) -> None:
        """Order an emergency stop; it takes effect in the next cycle."""
        self.order = msgspec.structs.replace(self.order, stop=self.order.stop + 1)

    def settle(self) -> None:
        """Advance until the robot is at rest: at the start its drives may be holding it."""
        self.go(0.1)
        while self.mode is BodyMode.DAMPED:
            self.cycle()

    def stand(self) -> None:
        """Stand up, from off to standing."""
        self.settle()
        refusal = self.request(BodyRequest.STAND)
        self.go(3.0, until=BodyMode.STANDING)
        if self.mode is not BodyMode.STANDING:
            raise AssertionError(refusal or self.fault or f"it is {self.mode}")
