"""Asking for control of a robot: the page of the person who has it shows the request, and answers it; pure.

Whoever moved a robot last has control of it for a while (``control_lease``). To give it is to stop the
robot, which ends that at once; nothing else takes it from a person but time. Persons at other consoles are
not asked.
"""

from __future__ import annotations

from fleet.console.fleet_view import FleetView
from fleet.console.requests import ControlAsked, GiveAsked
from fleet.console.sessions import Operator
from fleet.errors import Refused


def asked(asked: ControlAsked, view: FleetView, operator: Operator, now: float) -> dict[str, object]:
    """Return the request as pages show it, made ``now`` (Unix s); raises Refused without anybody to ask."""
    state = view.states.get(asked.robot)
    if state is None:
        raise Refused(f"there is no robot {asked.robot}")
    if state.run:
        raise Refused(f"it is in run {state.run}; the command take takes it out of the run")
    if not state.control:
        raise Refused("nobody has control of it: it can be commanded")
    if state.control == operator.name:
        raise Refused("you have control of it")
    told = {"request": asked.request, "by": operator.name, "holder": state.control, "answer": ""}
    return told | {"at": now}


def answered(asked: GiveAsked, view: FleetView, operator: Operator) -> dict[str, object]:
    """Return the request with its answer; raises Refused for somebody who was not asked."""
    found: dict[str, object] | None = view.get("requests", asked.robot)
    if found is None or found["holder"] != operator.name or found["answer"]:
        raise Refused("nobody asks you for it")
    return found | {"answer": "given" if asked.give else "kept"}
