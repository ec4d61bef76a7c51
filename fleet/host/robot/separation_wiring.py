"""Wiring of a robot's separation keeper to its controller."""

from __future__ import annotations

from fleet.clock import Clock
from fleet.host.robot.controller import RobotController
from fleet.host.robot.robot_positions import RobotPositions
from fleet.host.robot.separation_keeper import SeparationKeeper
from fleet.robot_config import AdapterConfig, Limits


def keeper_of(
    config: AdapterConfig,
    limits: Limits,
    controller: RobotController,
    traffic: RobotPositions,
    clock: Clock,
) -> SeparationKeeper:
    """Return the keeper that separates a robot from the others in ``traffic``."""
    guard, can = controller.guard, controller.can
    return SeparationKeeper(
        config,
        can.separation,
        limits,
        clock=clock,
        others=traffic,
        mover=controller,
        led=not can.navigates,
        held=lambda: guard.held,
        points=guard.points,
        event_reporter=controller.event_reporter,
    )
