"""Velocity of one robot: combined keys, limits, fence, and the dead-man."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from fleet.adapter import Adapter
from fleet.clock import Clock
from fleet.errors import CommandError, LinkError, Refused
from fleet.host.requests.event_reporter import robot_log
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.joint_control import JointControl
from fleet.host.robot.motion_guard import MotionGuard
from fleet.host.safety.deadman import DeadMan
from fleet.host.safety.held_keys import HeldKeys
from fleet.host.safety.velocity_limits import clamp
from fleet.model.command import Setpoint
from fleet.model.geometry import ZERO_VELOCITY, Velocity
from fleet.robot_config import AdapterConfig, Limits
from fleet.runtime.exception_barrier import call_guarded, failure_text

UNHEARD = 10.0
"""Seconds for which a robot may already have been out of reach when its loss is noticed: it may not have
heard the zero velocity that ended its motion in this time."""


class VelocityControl:
    """Velocity control of one robot. ``lease``: default life of a setpoint, s; ``combines``: verbs add up.

    ``guard`` keeps the velocity within the fence and checks it again with each pose. ``halt`` writes the
    robot's halt; ``barred`` returns why nothing may move it, else None; ``crashed`` receives an unexpected
    error of the adapter.
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
        self.joints = JointControl(clock, lease, barred=barred, halt=halt, crashed=crashed)
        self._limits = limits
        self._clock = clock
        self._lease = lease
        self._guard = guard
        self.barred = barred
        self._halt = halt
        self._crashed = crashed
        self._keys = HeldKeys() if combines else None
        self._adapter: Adapter[Any] | None = None
        self._wanted = ZERO_VELOCITY  # before the guard's restrictions
        self._driven_until = -math.inf  # monotonic s
        self.streamed = False  # the velocity renewed one before it; a single one ends by its lease

    def configure(self, config: AdapterConfig, limits: Limits) -> None:
        """Apply changed limits, also to the velocity being held."""
        self._limits, self._lease, self.joints.lease = limits, config.setpoint_lease, config.setpoint_lease
        self._wanted = clamp(self._wanted, limits)
        try:
            self.reapply_velocity()
        except Exception as error:  # noqa: BLE001 - the held velocity must not stay beyond the limits
            self._halt()
            self.release()
            if not isinstance(error, CommandError | LinkError):
                self._crashed(error)

    @property
    def activity(self) -> str:
        """Short text about the present motion; empty without any."""
        return "driving" if self.deadman.armed else "joints led" if self.joints.deadman.armed else ""

    @property
    def drove_lately(self) -> bool:
        """True while a robot whose loss is noticed now may have missed a velocity, such as zero."""
        return self._clock.monotonic() - self._driven_until < UNHEARD

    def seen_standing(self) -> None:
        """Note that the robot was seen to stand."""
        if not self.deadman.armed:
            self._driven_until = -math.inf

    def apply(self, adapter: Adapter[Any], request: Setpoint, receipt: Receipt, *, superseding: bool) -> bool:
        """Make the adapter hold a setpoint, and answer; return whether it does.

        ``superseding``: the robot already moves, so it is halted if it does not take the new velocity.
        """
        velocity, lease = request.velocity, request.lease or self._lease
        if self._keys is not None:
            velocity, lease = self._keys.press(request.name, velocity, self._clock.monotonic(), lease)
        self.streamed = self.deadman.armed
        try:
            self.hold(adapter, velocity, lease)
        except (CommandError, LinkError) as error:
            # The old velocity is no longer wanted. A refused new one is not executed; one whose link failed
            # may have been written.
            if superseding or isinstance(error, LinkError):
                self._halt()
            self.release()
            receipt.fail(error)
        except Exception as error:  # noqa: BLE001 - exception barrier: passed to the runner, which stops the robot
            self._halt()
            self.release()
            receipt.reject(f"the adapter failed: {failure_text(error)}")
            self._crashed(error)
        else:
            receipt.done()
            return True
        return False

    def hold(self, adapter: Adapter[Any], velocity: Velocity, lease: float) -> None:
        """Make the adapter hold a velocity for its lease (s); raises the adapter's errors."""
        self._adapter, self._wanted = adapter, clamp(velocity, self._limits)
        velocity = self._guard.limited_velocity(self._wanted)
        now, zero = self._clock.monotonic(), velocity.is_zero
        self.deadman.feed(now, lease)
        self._guard.held = velocity
        self._driven_until = now + lease
        if zero:
            self._driven_until = now
            self.deadman.clear()
        call_guarded(adapter.drive, velocity)
        if not zero and (why := self.barred()):  # set meanwhile by another thread
            self._halt()
            self.release()
            raise Refused(why)
        self._guard.taken = self._guard.taken and zero

    def reapply_velocity(self) -> None:
        """Hold the requested velocity as far as the guard admits it now; the lease is not renewed."""
        velocity = self._guard.limited_velocity(self._wanted)
        if self.barred() is not None or velocity == self._guard.held:
            return
        if self._adapter is not None and self.deadman.armed:
            self._guard.held = velocity
            call_guarded(self._adapter.drive, velocity)

    def stand(self, adapter: Adapter[Any]) -> None:
        """Make the adapter hold zero velocity; if it cannot, halt the robot."""
        self.release()
        self._driven_until = self._clock.monotonic()
        try:
            call_guarded(adapter.drive, ZERO_VELOCITY)
        except (CommandError, LinkError) as error:
            robot_log(adapter.config.name).warning("%s", error)
            self._halt()
        except Exception as error:  # noqa: BLE001 - exception barrier: passed to the runner, which ends the run
            self._halt()
            self._crashed(error)

    def release(self) -> None:
        """Stop holding velocities and joint targets, and release all keys."""
        self.deadman.clear()
        self.joints.release()
        self._guard.held = ZERO_VELOCITY
        if self._keys is not None:
            self._keys.lift()
