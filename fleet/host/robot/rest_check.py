"""Rest check: only at rest is a robot's adapter ended, or a restriction loosened."""

from __future__ import annotations

from fleet.host.robot.local_robot import LocalRobot

STILL = 0.05  # m/s; below it the reported speed is noise


def moving(robot: LocalRobot) -> str:
    """Return how a robot moves, or may move; empty for one that stands and is idle."""
    controller, state = robot.controller, robot.state()
    if controller.in_motion:
        return f"{state.name} is commanded ({controller.activity or 'moving'}); stop it first"
    if controller.motion.may_be_moving:
        return f"{state.name} was lost in motion and may still move"
    if state.armed:
        return f"{state.name} is armed; disarm it first"
    if state.speed is not None and state.speed > STILL:
        return f"{state.name} moves at {state.speed:.2f} m/s"
    return ""


def not_resting(robot: LocalRobot) -> str:
    """Return what the end of the robot's adapter would interrupt; empty for a robot at rest."""
    if moves := moving(robot):
        return moves
    state = robot.state()
    holder = robot.controller.lease.control(robot.clock.monotonic())
    if state.run:
        return f"{state.name} is in run {state.run}; fleet take takes it out of the run"
    return f"{state.name}: {holder}" if holder else ""
