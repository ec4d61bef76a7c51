"""Writes docs/reference/vehicles.md from the vocabulary of the MAVLink adapter; run it after changing that.

python docs/reference/make_vehicle_reference.py
"""  # noqa: INP001 - a script beside its result

from __future__ import annotations

import pathlib
from typing import Any

from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.constants import ARDUPILOT, PX4
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.state import VehicleState
from fleet_mavlink.vehicle import missing_commands
from fleet_mavlink.vocabulary import VERBS

TARGET = pathlib.Path(__file__).with_name("vehicles.md")
INTRODUCTION = """\
# What each MAVLink vehicle takes

By the type and the autopilot in its heartbeat; a VTOL also by how it flies just now. Made from the adapter by
`docs/reference/make_vehicle_reference.py`; do not edit. A number is the reason for which the name is refused:
`fleet describe` does not list it, and who sends it is told the reason. Stops (`stop`, `hover`, `brake`,
`emergency_stop`) are taken by every vehicle. Pages: [drones](../how-to/mavlink.md),
[rovers and boats](../how-to/rovers.md), [planes and VTOLs](../how-to/planes.md),
[vehicles that are not moved](../how-to/mavlink.md#vehicles-that-are-not-moved-here).
"""


def _state(vehicle_type: int, autopilot: int, **more: Any) -> VehicleState:
    """Return what a vehicle of a type has told."""
    return VehicleState(Heartbeat(vehicle_type, autopilot), **more)


VEHICLES = {
    "multirotor, ArduPilot": _state(2, ARDUPILOT),
    "multirotor, PX4": _state(2, PX4),
    "rover, ArduPilot": _state(10, ARDUPILOT),
    "boat, ArduPilot": _state(11, ARDUPILOT),
    "rover, boat, PX4": _state(10, PX4),
    "plane": _state(1, PX4),
    "VTOL in its hover, PX4": _state(22, PX4, vtol_state=3),
    "VTOL on its wings, PX4": _state(22, PX4, vtol_state=4),
    "QuadPlane": _state(1, ARDUPILOT, vtol_state=3, settings={"Q_GUIDED_MODE": 1.0}),
    "QuadPlane, Q_GUIDED_MODE 0": _state(1, ARDUPILOT, vtol_state=3),
    "submarine": _state(12, ARDUPILOT),
}
MORE = {"goto": "goals, paths, distances", "plan": "missions"}


def names() -> list[str]:
    """Return the vocabulary: verbs, goals and missions, then commands by name."""
    commands = sorted(set(MavlinkAdapter.commands()) - set(VERBS))
    return [*VERBS, *MORE, *commands]


def render() -> str:
    """Return the whole table."""
    lacking = {name: missing_commands(state) for name, state in VEHICLES.items()}
    reasons: dict[str, int] = {}
    rows = []
    for name in names():
        cells = []
        for of_vehicle in lacking.values():
            reason = of_vehicle.get(name)
            if reason is not None and reason.startswith("it is a"):
                reason = f"it is not moved here: {reason.partition('not moved here: ')[2]}"
            cells.append("yes" if reason is None else str(reasons.setdefault(reason, len(reasons) + 1)))
        shown = MORE.get(name, f"`{name}`")
        rows.append(f"| {shown} | {' | '.join(cells)} |")
    head = [f"| | {' | '.join(lacking)} |", f"|---|{'---|' * len(lacking)}"]
    notes = [f"{number}. {reason}" for reason, number in reasons.items()]
    return "\n".join([INTRODUCTION.rstrip(), "", *head, *rows, "", *notes]) + "\n"


if __name__ == "__main__":
    TARGET.write_text(render(), encoding="utf-8")
