"""The velocity that one robot holds: keys combined, clamped, within the fence, under the dead-man."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.errors import CommandError, LinkError
from fleet.host.requests.event_reporter import robot_log
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.joint_control import JointDriving
from fleet.host.robot.motion_guard import MotionGuard
from fleet.host.safety.deadman import DeadMan
from fleet.host.safety.held_keys import HeldKeys
from fleet.host.safety.velocity_limits import clamp
from fleet.model.command import Setpoint
from fleet.model.geometry import ZERO_VELOCITY, Velocity
from fleet.robot_config import AdapterConfig, Limits
from fleet.runtime.exception_barrier import call_guarded


class VelocityControl:
    """``lease``: seconds that a setpoint lives which does not say; ``combines``: its verbs are keys.

    ``guard`` keeps what is held within the fence, and looks at it again with each pose. ``halt`` writes the
    robot's halt, ``barred`` says why nothing may move it, ``crashed`` hears of an adapter that raised what it
    may not.
    """

    def __init__(
        self,
        limits: Limits,
        clock: Clock,
        lease: float,
        guard: MotionGuard,
        *,
        combines: bool,
        halt: Callable[[], None],
        crashed: Callable[[Exception], None],
        barred: Callable[[], str | None],
    ) -> None:
        self.deadman = DeadMan()
        self.joints = JointDriving(clock, lease, barred=barred, halt=halt, crashed=crashed)
        self._limits = limits
        self._clock = clock
        self._lease = lease
        self._guard = guard
        self._halt = halt
        self._crashed = crashed
        self._keys = HeldKeys() if combines else None
        self._adapter: Adapter[Any] | None = None
        self._wanted = ZERO_VELOCITY  # before the guard had its say

    def configure(self, config: AdapterConfig, limits: Limits) -> None:
        """Keep other limits from now on; a velocity that is held is held within them at once."""
        self._limits, self._lease, self.joints.lease = limits, config.setpoint_lease, config.setpoint_lease
        self._wanted = clamp(self._wanted, limits)
        try:
            self.hold_again()
        except Exception as error:  # noqa: BLE001 - what is held already must not go on beyond the limits
            self._halt()
            self.let_go()
            if not isinstance(error, CommandError | LinkError):
                self._crashed(error)

    @property
    def activity(self) -> str:
        """What is held or led, in a word or two; empty when nothing."""
        return "driving" if self.deadman.armed else "joints led" if self.joints.deadman.armed else ""

    def take(self, adapter: Adapter[Any], ask: Setpoint, receipt: Receipt, *, superseding: bool) -> bool:
        """Have the adapter hold what was asked, and answer; return whether it does.

        ``superseding``: the robot moves already, so it is halted when it does not do what is wanted now.
        """
        velocity, lease = ask.velocity, ask.lease or self._lease
        if self._keys is not None:
            velocity, lease = self._keys.press(ask.name, velocity, self._clock.monotonic(), lease)
        try:
            self.hold(adapter, velocity, lease)
        except (CommandError, LinkError) as error:
            # What it did until now is not wanted any more, and what is wanted it does not do.
            if superseding:
                self._halt()
            self.let_go()
            receipt.fail(error)
        except Exception as error:  # noqa: BLE001 - the wall: told to the runner, which stops the robot
            self._halt()
            self.let_go()
            receipt.reject(f"the adapter failed: {type(error).__name__}: {error}")
            self._crashed(error)
        else:
            receipt.done()
            return True
        return False

    def hold(self, adapter: Adapter[Any], velocity: Velocity, lease: float) -> None:
        """Have the adapter hold a velocity for its lease (s); raises what the adapter raises."""
        self._adapter, self._wanted = adapter, clamp(velocity, self._limits)
        velocity = self._guard.within(self._wanted)
        self.deadman.feed(self._clock.monotonic(), lease)
        self._guard.held = velocity
        if velocity.is_zero:
            self.deadman.clear()
        call_guarded(adapter.drive, velocity)
        self._guard.taken = self._guard.taken and velocity.is_zero

    def hold_again(self) -> None:
        """Have the adapter hold what is wanted, as far as the guard lets it pass now; its lease runs on."""
        velocity = self._guard.within(self._wanted)
        if self._adapter is not None and self.deadman.armed and velocity != self._guard.held:
            self._guard.held = velocity
            call_guarded(self._adapter.drive, velocity)

    def stand(self, adapter: Adapter[Any]) -> None:
        """Have the adapter hold zero velocity; one that cannot even do that is halted."""
        self.let_go()
        try:
            call_guarded(adapter.drive, ZERO_VELOCITY)
        except (CommandError, LinkError) as error:
            robot_log(adapter.config.name).warning("%s", error)
            self._halt()
        except Exception as error:  # noqa: BLE001 - the wall: told to the runner, which ends the run
            self._halt()
            self._crashed(error)

    def let_go(self) -> None:
        """Hold no velocity any more, whatever keys are down, and lead no joint."""
        self.deadman.clear()
        self.joints.let_go()
        self._guard.held = ZERO_VELOCITY
        if self._keys is not None:
            self._keys.lift()
