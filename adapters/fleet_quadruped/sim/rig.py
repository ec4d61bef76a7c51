"""A dog in lock-step with its controller: for tests, measurements and tuning; time passes only in ``go``."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import msgspec

from fleet_quadruped.body.gait import Twist
from fleet_quadruped.body.requests import BodyRequest
from fleet_quadruped.control.controller import Controller
from fleet_quadruped.control.orders import Activity, DogState, Order, Timing
from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.safety.stages import Mode
from fleet_quadruped.sim.lockstep import lockstep
from fleet_quadruped.sim.world import World

_NEAR = 0.1  # rad: what a joint that is lowered is sent on in a cycle, at the most


class Rig:
    """A simulated dog that is configured and off. ``order`` is what its host says, kept fresh."""

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
        self.skew = 0.0  # s by which the controller's clock has jumped
        self.tilt = 0.0  # greatest since the last ``go`` began, rad
        self.watch: Callable[[], None] = lambda: None

    @property
    def mode(self) -> Mode:
        """What the body is doing."""
        return self.controller.body.mode

    @property
    def fault(self) -> str:
        """The latched fault."""
        return self.controller.body.fault

    def state(self) -> DogState:
        """Return what the controller tells."""
        return self.controller.state(self.sim.time + self.skew, Timing())

    def cycle(self) -> None:
        """Run one control cycle."""
        now, dt = self.sim.time + self.skew, self.dog.dt
        self.controller.begin(now)
        for name, bus in self.buses.items():
            for frame in bus.receive(0.0):
                self.controller.take(name, frame, now)
        if self.alive:
            self.order = msgspec.structs.replace(self.order, until=now + 1.0, alive=now)
        self.controller.finish(now, dt, self.order)
        self.sim.advance(dt)
        self.tilt = max(self.tilt, self.sim.world.imu().tilt)
        self.watch()

    def gives_way(self, joints: Iterable[int] = range(12)) -> bool:
        """Return True when joints (by their places) damp, or already go where they are lowered to."""
        targets = self.controller.targets
        motors = ((self.sim.world.motors[number], targets[number]) for number in joints)
        return self.mode is Mode.DAMPED and all(
            motor.kd >= 2.9 and (motor.kp == 0 or abs(motor.target - target) < _NEAR)
            for motor, target in motors
        )

    def reconnect(self) -> None:
        """Begin anew with the same dog, as after a lost link."""
        self.order = Order()
        self.controller = Controller(self.dog, self.buses)
        self.controller.drives.configure()

    def go(self, seconds: float, twist: Twist = Twist()) -> None:  # noqa: B008 - a tuple does not change
        """Let time pass with a velocity."""
        self.order = msgspec.structs.replace(self.order, x=twist.x, y=twist.y, turn=twist.turn)
        self.tilt = 0.0
        for _ in range(round(seconds / self.dog.dt)):
            self.cycle()

    def ask(self, ask: BodyRequest, value: float = 0.0) -> str:
        """Ask the body for something; return why it refuses, empty when it does it."""
        self.order = msgspec.structs.replace(
            self.order, activity=Activity(self.order.activity.number + 1, ask, value)
        )
        self.cycle()
        return self.state().refusal

    def emergency(self) -> None:
        """Ask for an emergency stop; it is obeyed in the next cycle."""
        self.order = msgspec.structs.replace(self.order, stop=self.order.stop + 1)

    def settle(self) -> None:
        """Let a dog come to rest that is met, and may be held by its drives."""
        self.go(0.1)
        while self.mode is Mode.DAMPED:
            self.cycle()

    def stand(self) -> None:
        """Stand up, from off to standing."""
        self.settle()
        refusal = self.ask(BodyRequest.STAND)
        self.go(3.0)
        if self.mode is not Mode.STANDING:
            raise AssertionError(refusal or self.fault or f"it is {self.mode}")
