"""``fleet calibrate``: drive a metre and a turn, ask for the true values, write the calibration."""

from __future__ import annotations

import math
import uuid
from pathlib import Path

import click

from fleet.cli.output import ExitCode, Output, with_output
from fleet.cli.robot_queries import RobotQuery
from fleet.client.edges import Edges
from fleet.client.local_user import stamped
from fleet.config.load import load
from fleet.errors import Refused
from fleet.model.geometry import Vector3
from fleet.model.state import RobotState

DISTANCE = 1.0  # m
SPEED = 0.15  # m/s; slow, so that no wheel slips
WITHIN = 120.0  # s for each drive
STOP_WITHIN = 5.0  # s for the answer to a stop
SANE = (0.5, 2.0)  # factors outside indicate an error in measuring


def calibrated(
    before: dict[str, float], *, reported: float, distance: float, off: float, track: float
) -> dict[str, float]:
    """Return new calibration values from the ones in use (``before``).

    ``reported`` and ``distance``: metres by the robot and in truth; ``off``: degrees of the true rotation
    beyond a full turn, left positive; ``track``: the effective track in use, m. Raises Refused.
    """
    further, turned = distance / max(reported, 1e-6), 1.0 + off / 360.0
    for what, factor in (("way", further), ("turn", turned)):
        if not SANE[0] <= factor <= SANE[1]:
            raise Refused(
                f"a {what} of {factor:.2f} times the reported value is not plausible", hint="measure again"
            )
    return {
        "track": round(track * further / turned, 5),
        "left": round(before.get("left", 1.0) * further, 5),
        "right": round(before.get("right", 1.0) * further, 5),
        "gyro": round(before.get("gyro", 1.0) * turned, 5),
    }


@click.command()
@click.argument("robot")
@click.option(
    "-f", "--file", default="fleet.yaml", show_default=True, type=click.Path(), help="Its fleet file."
)
@with_output
def calibrate(out: Output, robot: str, file: str) -> ExitCode:
    """Measure ROBOT's wheels and turns: it drives 1 m and turns once, each after your confirmation.

    Needs a running edge and 2 m of free floor. Writes ROBOT.calibration.yaml beside the fleet file.
    """
    before, track = _in_use(robot, file)
    with Edges.reach(file) as edges:
        reported = _drive(edges, robot)
        distance = click.prompt("How far did it go, in metres?", type=float, err=True)
        _turn(edges, robot)
        off = click.prompt("How many degrees is it off its mark (left positive)?", type=float, err=True)
    values = calibrated(before, reported=reported, distance=distance, off=off, track=track)
    path = Path(file).with_name(f"{robot}.calibration.yaml")
    path.write_text("".join(f"{name}: {value}\n" for name, value in values.items()), encoding="utf-8")
    out.data({"file": str(path), "calibration": values})
    out.say(f"{path} written; in {file}:  calibration: !include {path.name}")
    out.note(f"then start the edge anew, or: fleet send {robot} restart_adapter")
    return ExitCode.OK


def _in_use(name: str, file: str) -> tuple[dict[str, float], float]:
    """Return the calibration in use and the effective track (m) of a robot of a fleet file."""
    for config, _ in load(file, partial=True).robots:
        if config.name == name:
            given = getattr(config, "calibration", None)
            if given is None:
                raise Refused(f"{name} is no robot that can be calibrated")
            return given.model_dump(exclude_none=True), float(getattr(config, "track", 0.0))
    raise Refused(f"{file} has no robot {name!r}")


def _drive(edges: Edges, name: str) -> float:
    """Drive straight ahead; return the distance in metres by the robot's odometry."""
    click.confirm(f"{name} will drive {DISTANCE:g} m straight on. Is the way free?", abort=True, err=True)
    start = _place(edges, name)
    _go(edges, name, "relative_move", relative_translation=[DISTANCE, 0.0, 0.0], frame="body")
    return (_place(edges, name) - start).norm()


def _turn(edges: Edges, name: str) -> None:
    """Turn to a heading, let the user mark it, and turn once around to the left."""
    click.confirm(f"{name} will turn on the spot, to be marked. Is it free?", abort=True, err=True)
    at = _place(edges, name)
    here = {"position": [at.x, at.y, 0.0]}
    _go(edges, name, "goto", **here, yaw=0.0)
    click.confirm("Mark its heading. Now it turns once round to the left. Ready?", abort=True, err=True)
    for quarter in (1, 2, 3, 4):
        _go(edges, name, "goto", **here, yaw=math.remainder(quarter * math.pi / 2, math.tau))


def _go(edges: Edges, name: str, command: str, **fields: object) -> None:
    """Send a robot to a goal and wait until it is there; raises Refused with the reason."""
    message = {"command": command, "action_id": uuid.uuid4().hex, **fields}
    message["constraints"] = {"max_speed_ms": SPEED}
    robot, standing = _robot(edges, name), False
    try:
        for last in edges.command(robot, stamped(message), kind="navigate", wait=True, timeout=WITHIN):
            standing = last.done or not last.ok
            if not last.ok:
                raise Refused(f"{name}: {last.reason}")
        if not standing:
            raise Refused(f"{name} did not get there within {WITHIN:g} s")
    finally:  # an interrupt is meant for the robot as well
        if not standing:
            _stop(edges, robot)


def _stop(edges: Edges, robot: RobotState) -> None:
    """Stop a robot."""
    message = stamped({"command": "stop", "data": {}})
    for _ in edges.command(robot, message, kind="command", wait=False, timeout=STOP_WITHIN):
        pass


def _place(edges: Edges, name: str) -> Vector3:
    """Return the reported position of a robot."""
    position = _robot(edges, name).position
    if position is None:
        raise Refused(f"{name} reports no position")
    return position


def _robot(edges: Edges, name: str) -> RobotState:
    """Return the present state of the robot of this name."""
    return RobotQuery(edges, name).robot
