"""Restarts one robot of this process with a changed configuration.

Its controller, its stop and its records of past requests stay; only its adapter and its link are new. The
other robots are not affected.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

import msgspec

from fleet.host.process.robot_process import RobotProcess
from fleet.host.robot.local_robot import LocalRobot
from fleet.host.safety.stricter import as_strict_as_both, is_equally_strict
from fleet.robot_config import AdapterConfig

log = logging.getLogger(__name__)

ENDS_WITHIN = 12.0  # s for a run to bring its robot to a standstill and end
BACK_WITHIN = 20.0  # s for a robot that was online to be online again
POLL_INTERVAL = 0.05  # s between checks
RESTORED = "its previous configuration was restored"


async def rebuild(process: RobotProcess, robot: LocalRobot, config: AdapterConfig) -> str:
    """Run a robot with another configuration; return why the old one was restored, empty on success.

    A robot that was online must be online again within ``BACK_WITHIN``.
    """
    before, answered = robot.config, not robot.controller.offline
    trouble = await end_run(process, robot)
    if trouble:
        return trouble
    trouble = apply_configuration(robot, config)
    process.runs.resume(robot)
    if trouble:
        return trouble
    if not answered or await wait_until(lambda: not robot.controller.offline, BACK_WITHIN):
        return ""
    cause = robot.state().cause
    stuck = await end_run(process, robot)
    robot.configure(before)
    if not stuck:
        process.runs.resume(robot)
    return f"it did not answer within {BACK_WITHIN:g} s: {cause}" + (f"; {stuck}" if stuck else "")


def apply_configuration(robot: LocalRobot, config: AdapterConfig) -> str:
    """Apply a configuration to a robot's host side; return why the old one is kept, if so."""
    before = robot.config
    try:
        robot.configure(config)
    except Exception as error:  # an adapter's Config has code of its own, and the robot must go on
        log.exception("%s does not take its configuration over", robot.name)
        robot.configure(before)
        return f"it does not take it over: {type(error).__name__}: {error}"
    return ""


class HeldConfiguration(msgspec.Struct, frozen=True):
    """Configuration of a robot after ``hold``: the whole new one (``complete``), part of it, or the old one.

    ``trouble`` is why it was not applied.
    """

    config: AdapterConfig
    changed: bool = False
    complete: bool = False
    trouble: str = ""


def hold(robot: LocalRobot, config: AdapterConfig, *, whole: bool) -> HeldConfiguration:
    """Restrict a robot that may move to the stricter parts of a new configuration.

    ``whole``: its adapter can continue with all of it, so all is applied if nothing in it is looser.
    """
    before, can = robot.config, robot.controller.can
    both = as_strict_as_both(before, config, limits=can.limits, separation=can.separation)
    complete = whole and is_equally_strict(both, config, can.limits, can.separation)
    if not complete and is_equally_strict(both, before, can.limits, can.separation):
        return HeldConfiguration(before)
    target = config if complete else both
    if trouble := apply_configuration(robot, target):
        return HeldConfiguration(before, trouble=trouble)
    return HeldConfiguration(target, changed=True, complete=complete)


async def end_run(process: RobotProcess, robot: LocalRobot) -> str:
    """End a robot's run; return why it cannot be restarted."""
    process.runs.pause(robot)
    if not await wait_until(lambda: process.runs.is_paused(robot), ENDS_WITHIN):
        return "its run does not end; restart the edge"
    if robot.runner.leftover is None:
        return ""
    why = "its adapter does not end; restart the edge, and give it a worker of its own"
    robot.stand_by(why)
    return why


async def wait_until(condition: Callable[[], bool], within: float) -> bool:
    """Wait until a condition holds, at most ``within`` seconds; return whether it does."""
    loop = asyncio.get_running_loop()
    end = loop.time() + within
    while not condition() and loop.time() < end:  # noqa: ASYNC110 - the condition has no event
        await asyncio.sleep(POLL_INTERVAL)
    return condition()
