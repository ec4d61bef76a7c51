"""Requests for control of a robot: shown on the holder's page, which answers them; pure.

The operator who moved a robot last has control of it for a while (``control_lease``). Giving it up stops the
robot, which ends the lease at once; otherwise it ends only by time. Operators at other consoles receive no
request.
"""

from __future__ import annotations

from fleet.console.fleet_view import FleetView
from fleet.console.requests import PageControlRequest, PageGiveRequest
from fleet.console.sessions import ConsoleUser
from fleet.errors import Refused


def requested(
    requested: PageControlRequest, view: FleetView, operator: ConsoleUser, now: float
) -> dict[str, object]:
    """Return the request for pages, made at ``now`` (Unix s); raises Refused without a holder."""
    state = view.states.get(requested.robot)
    if state is None:
        raise Refused(f"there is no robot {requested.robot}")
    if state.run:
        raise Refused(f"it is in run {state.run}; the command take takes it out of the run")
    if not state.control:
        raise Refused("no operator has control of it: it can be commanded")
    if state.control == operator.name:
        raise Refused("you have control of it")
    entry = {"request": requested.request, "by": operator.name, "holder": state.control, "answer": ""}
    return entry | {"at": now}


def answered(requested: PageGiveRequest, view: FleetView, operator: ConsoleUser) -> dict[str, object]:
    """Return the request with its answer; raises Refused for an operator who was not asked."""
    found: dict[str, object] | None = view.get("requests", requested.robot)
    if found is None or found["holder"] != operator.name or found["answer"]:
        raise Refused("there is no request for it")
    return found | {"answer": "given" if requested.give else "kept"}
