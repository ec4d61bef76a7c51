"""Writes docs/reference/vehicles.md from the vocabulary of the MAVLink adapter; run it after changing that.

python docs/reference/make_vehicle_reference.py
"""  # noqa: INP001 - a script beside its result

from __future__ import annotations

import pathlib

from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.constants import ARDUPILOT, PX4
from fleet_mavlink.messages import Heartbeat
from fleet_mavlink.vehicle import lacking_of
from fleet_mavlink.vocabulary import VERBS

TARGET = pathlib.Path(__file__).with_name("vehicles.md")
INTRODUCTION = """\
# What each MAVLink vehicle takes

By the type and the autopilot in its heartbeat. Made from the adapter by
`docs/reference/make_vehicle_reference.py`; do not edit. A number is the reason for which the name is refused:
`fleet describe` does not list it, and who sends it is told the reason. Stops (`stop`, `hover`, `brake`,
`emergency_stop`) are taken by every vehicle. Pages: [drones](../how-to/mavlink.md),
[rovers and boats](../how-to/rovers.md),
[vehicles that are not moved](../how-to/mavlink.md#vehicles-that-are-not-moved-here).
"""
VEHICLES = {
    "multirotor, ArduPilot": (2, ARDUPILOT),
    "multirotor, PX4": (2, PX4),
    "rover, ArduPilot": (10, ARDUPILOT),
    "boat, ArduPilot": (11, ARDUPILOT),
    "rover, boat, PX4": (10, PX4),
    "plane": (1, PX4),
    "VTOL": (22, PX4),
    "submarine": (12, ARDUPILOT),
}
MORE = {"goto": "goals, paths, distances", "plan": "missions"}


def names() -> list[str]:
    """Return the vocabulary: verbs, goals and missions, then commands by name."""
    commands = sorted(set(MavlinkAdapter.commands()) - set(VERBS))
    return [*VERBS, *MORE, *commands]


def render() -> str:
    """Return the whole table."""
    lacking = {name: lacking_of(Heartbeat(*kind)) for name, kind in VEHICLES.items()}
    reasons: dict[str, int] = {}
    rows = []
    for name in names():
        cells = []
        for of_vehicle in lacking.values():
            reason = of_vehicle.get(name)
            if reason is not None and reason.startswith("it is a"):
                reason = "it is not moved here: it is watched, and stopped"
            cells.append("yes" if reason is None else str(reasons.setdefault(reason, len(reasons) + 1)))
        shown = MORE.get(name, f"`{name}`")
        rows.append(f"| {shown} | {' | '.join(cells)} |")
    head = [f"| | {' | '.join(lacking)} |", f"|---|{'---|' * len(lacking)}"]
    notes = [f"{number}. {reason}" for reason, number in reasons.items()]
    return "\n".join([INTRODUCTION.rstrip(), "", *head, *rows, "", *notes]) + "\n"


if __name__ == "__main__":
    TARGET.write_text(render(), encoding="utf-8")
