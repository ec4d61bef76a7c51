"""The simulated base of a rehearsal: the same board as behind ``sim:`` links, in simulated time."""

from __future__ import annotations

from fleet import Simulation, SimulationStart
from fleet_ugv.battery import Curve, percent, voltage
from fleet_ugv.config import UgvConfig
from fleet_ugv.odometry import POSE
from fleet_ugv.sim.board import SimBoard
from fleet_ugv.sim.spec import BOARDS, BaseSpec, board_of, spec_of

MOVES = 0.01  # m/s of a side from which on it counts as moving


def simulated_base(config: UgvConfig, start: SimulationStart) -> Simulation | None:
    """Return a base whose odometry begins where that of the robot is; None for a profile without simulator.

    Its battery drains while it moves, where fleet.yaml says how long a full one lasts
    (``battery_policy.endurance``).
    """
    setting = config.setting
    if config.simulated:
        spec = spec_of(config.link, ticks=setting.ticks, diameter=setting.diameter)
    elif config.profile in BOARDS:
        spec = BaseSpec(config.profile, start.seed, ticks=setting.ticks, diameter=setting.diameter)
    else:
        return None
    board = board_of(spec)
    curve = config.battery or config.base.curve
    if start.battery is not None and curve:
        board.set_fault("low_battery", voltage(start.battery, curve))
    endurance = config.battery_policy.endurance if config.battery_policy is not None else None
    drains = endurance is not None and bool(curve)
    return Simulation(
        what=f"simulated {spec.profile}" + ("" if drains else ", whose battery does not drain"),
        config=config.model_copy(update={"link": f"memory:{config.name}"}),
        receive=board.receive,
        step=_Draining(board, curve, endurance).step if endurance is not None and curve else board.step,
        state={POSE: start.pose},
    )


class _Draining:
    """A board whose battery drains; a full one lasts ``endurance`` seconds of motion."""

    def __init__(self, board: SimBoard, curve: Curve, endurance: float) -> None:
        self._board, self._curve, self._endurance = board, curve, endurance
        self._charge = percent(board.voltage, curve)
        self._then = 0.0

    def step(self, now: float) -> bytes:
        """Let time pass."""
        output = self._board.step(now)
        if max(map(abs, self._board.physics.speeds)) > MOVES:
            self._charge = max(0.0, self._charge - 100.0 * (now - self._then) / self._endurance)
            self._board.voltage = voltage(self._charge, self._curve)
        self._then = now
        return output
