"""Motion trials of the contract tests: move and stop a robot as the host does."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator

from fleet.errors import CommandError, LinkError
from fleet.host.robot.adapter_factory import AdapterClass
from fleet.model.geometry import ZERO_VELOCITY, Vector3, Velocity
from fleet.robot_config import AdapterConfig
from fleet.testing.bench import STEP, Bench
from fleet.testing.operator import PERIOD
from fleet.testing.probes import in_time, near

STOP_WITHIN = 5.0  # s that the host allows for a stop
STILL = 0.3  # s of standstill before the robot counts as standing: legs take a last step
UNHEARD = 1.5  # s without a pose that count as STILL seconds of standstill
GOES_ON = 1.0  # s for which a stopped robot is observed


class MotionTrial:
    """Moves and stops a robot and checks the result; raises AssertionError.

    ``velocity`` returns the robot's present velocity, None while it is unknown. ``settles``: s until the
    robot follows a command.
    """

    def __init__(self, bench: Bench, velocity: Callable[[], Velocity | None], settles: float) -> None:
        self._bench = bench
        self._velocity = velocity
        self._settles = settles

    async def stop(self) -> None:
        """Stop the robot as the host does; exceptions that an adapter may raise in a stop are no failure."""
        try:
            async with asyncio.timeout(STOP_WITHIN):
                await self._bench.adapter.stop("stop")
        except (CommandError, LinkError):
            pass
        except TimeoutError:
            raise AssertionError(f"stop does not return within {STOP_WITHIN:g} s") from None

    async def halt(self) -> None:
        """Halt the robot from another thread, as the dead-man does while the event loop is blocked."""
        in_time(self._bench.adapter.halt)

    async def drive(self, wanted: Velocity) -> None:
        """Repeat a velocity, as a stick does, until the robot has it."""
        for _ in range(round(self._settles / PERIOD)):
            self._bench.adapter.drive(wanted)
            await self._bench.pass_time(PERIOD)
            if near(self._velocity(), wanted):
                return
        raise AssertionError(f"asked for {wanted}, the robot does {self._velocity()}; unit, axis, sign?")

    async def expect_still(self, when: str) -> None:
        """Check that the robot comes to rest, and stays so for longer than any dead-man would take."""
        still = 0.0
        for _ in range(round(self._settles / STEP)):
            await self._bench.pass_time(STEP)
            # A robot at rest may report no pose, but a late report may still show motion.
            share = STILL / UNHEARD if self._velocity() is None else 1.0
            still = still + share * STEP if self._is_still() else 0.0
            if still > STILL - STEP / 2:
                break
        for _ in range(round(GOES_ON / STEP)):
            await self._bench.pass_time(STEP)
            assert self._is_still(), f"it moves {when}: {self._velocity()}"

    def _is_still(self) -> bool:
        """Return True if the robot stands or its velocity is unknown."""
        velocity = self._velocity()
        return velocity is None or near(velocity, ZERO_VELOCITY)


def trial_velocities(config: AdapterConfig, adapter: AdapterClass) -> Iterator[Velocity]:
    """Yield the velocities to try: a third of the limits, ahead and turning."""
    limits = config.limits.over(adapter.limits)
    yield Velocity(Vector3((limits.speed or 1.0) / 3))
    if limits.yaw_rate:
        yield Velocity(yaw_rate=limits.yaw_rate / 3)
