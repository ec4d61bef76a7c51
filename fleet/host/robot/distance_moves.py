"""Motion verbs with a distance (``move_forward {"distance": 1}``): a goal with a bound. Pure."""

from __future__ import annotations

from fleet.errors import WireError
from fleet.host.follow.leg_follower import TIGHTEST
from fleet.host.requests.decode import RobotRequest
from fleet.host.robot.adapter_factory import Capabilities
from fleet.model.command import Command
from fleet.model.geometry import Vector3
from fleet.model.navigation import Constraints, Navigate, RelativeMove
from fleet.wire.commands import Defaults
from fleet.wire.envelope import BadCommand
from fleet.wire.verbs import VERBS, Verb

SHORTEST = 2 * TIGHTEST  # m; anything shorter counts as arrived
LONGEST = 30.0  # s that such a move may take


def goal_of(request: RobotRequest | None, can: Capabilities, defaults: Defaults) -> RobotRequest | None:
    """Return the goal for a verb with a distance; any other request unchanged.

    Verbs that the adapter declares are left to it. Raises BadCommand with the reason for an invalid distance,
    and for one that takes longer than ``LONGEST`` at the speed of a verb, which ``defaults`` gives.
    """
    if request is None or request.name not in VERBS or request.name in can.commands:
        return request
    if not isinstance(request, Command):
        return request
    verb, distance = VERBS[request.name], float(request.data["distance"])
    speed = getattr(defaults(request.origin.session), verb.default)
    refusal = (
        can.lacking.get(request.name) or _refusal(verb, can) or ("" if speed else "its speed is set to 0")
    )
    if not refusal and not SHORTEST <= distance <= speed * LONGEST:
        refusal = f"{distance:g} m is not {SHORTEST:g} to {speed * LONGEST:g} m; send a goal for more"
    if refusal:
        raise BadCommand(WireError(refusal, where="data.distance"), command=request.name)
    translation = Vector3(**{verb.axis: verb.sign * distance})
    constraints = Constraints(max_speed=speed, tolerance=None if can.navigates else TIGHTEST)
    # The message id becomes the action id, so that a repeat does not move the robot again.
    return Navigate(
        RelativeMove(translation, constraints=constraints),
        request.id,
        request.origin,
        request.stamp,
        request.name,
    )


def _refusal(verb: Verb, can: Capabilities) -> str:
    """Return why a robot cannot move along an axis for a distance; empty when it can."""
    if verb.axis == "yaw":
        return f"a turn has no distance; say {verb.own_field} (rad/s)"
    if verb.axis == "y" and not can.holonomic:
        return "it does not move sideways"
    if verb.axis == "z" and can.limits.vertical_speed is None:
        return "it stays on the ground"
    return ""
