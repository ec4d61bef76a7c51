"""The simulated base of a rehearsal: the same board as behind ``sim:`` links, in simulated time."""

from __future__ import annotations

from fleet.simulation import Simulation, SimulationStart
from fleet_ugv.battery import voltage
from fleet_ugv.config import UgvConfig
from fleet_ugv.odometry import POSE
from fleet_ugv.sim.spec import BOARDS, SimSpec, board_of, spec_of


def simulated_base(config: UgvConfig, start: SimulationStart) -> Simulation | None:
    """Return a base whose odometry begins where that of the robot is; None for a profile without simulator.

    Its battery does not drain.
    """
    setting = config.setting
    if config.simulated:
        spec = spec_of(config.link, ticks=setting.ticks, diameter=setting.diameter)
    elif config.profile in BOARDS:
        spec = SimSpec(config.profile, start.seed, ticks=setting.ticks, diameter=setting.diameter)
    else:
        return None
    board = board_of(spec)
    curve = config.battery or config.base.curve
    if start.battery is not None and curve:
        board.set_fault("low_battery", voltage(start.battery, curve))
    return Simulation(
        what=f"simulated {spec.profile}, whose battery does not drain",
        config=config.model_copy(update={"link": f"memory:{config.name}"}),
        receive=board.receive,
        step=board.step,
        state={POSE: start.pose},
    )
