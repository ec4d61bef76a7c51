"""Whether a robot rests: only then is its adapter ended, or what holds it back loosened."""

from __future__ import annotations

from fleet.host.robot.local_robot import LocalRobot

STILL = 0.05  # m/s: slower is noise of what a robot tells


def moving(robot: LocalRobot) -> str:
    """Return how a robot moves, or may; empty for one that stands and has nothing to do."""
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
    """Return what a robot does that the end of its adapter would cut off; empty for one that rests."""
    if moves := moving(robot):
        return moves
    state = robot.state()
    holder = robot.controller.lease.control(robot.clock.monotonic())
    if state.run:
        return f"{state.name} is in run {state.run}; fleet take takes it out of the run"
    return f"{state.name}: {holder}" if holder else ""
