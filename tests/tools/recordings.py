"""Recording of a small fleet with known contents, for tests."""

import msgspec

from fleet.history.record import Record
from fleet.missions.report import RunRobot, RunState
from fleet.model.body import BodyPart
from fleet.model.command import Transport
from fleet.model.description import CommandDescription, FenceDescription, RobotDescription
from fleet.model.event import EventKind, Requester
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import JointReport, PoseReport
from fleet.model.schedule import ScheduleAnswer, ScheduleState
from fleet.model.site import Placement
from fleet.model.state import EdgeState, RobotState
from fleet.record.ring import Ring
from fleet.record.samples import SampleReader, event_message
from fleet.record.task import Bounds
from fleet.wire.databus import encode_report

TWINS = {"rex": "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11", "ann": "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12"}
PLACED = Vector3(10.0, 0.0)  # where the world of rex is in the site's frame


def write_recording(folder, begins, seconds, *, ends=True, edge="yard-1"):
    """Record so many seconds from ``begins`` (Unix s): rex goes east with 1 m/s from its place, ann stands.

    Each robot tells its pose twice a second, its state once. At 10 s rex is stopped, at 20 s ann has a fault.
    A run begins at 5 s and ends at 15 s. Its joint turns by 0.1 rad/s. At 15 s its fence is made smaller, and
    the schedule is switched off. Without ``ends`` the file looks as one that is still written.
    """
    ring = Ring(folder, Bounds(free=0))
    reader = SampleReader()
    file = ring.file(begins)

    def put(key, value, at):
        payload = value if isinstance(value, bytes) else msgspec.json.encode(value)
        for message in reader.read(edge, key, payload):
            file.add(message, round(at * 1e9))

    for half in range(2 * seconds):
        at, gone = begins + half / 2, half / 2
        for name, twin in TWINS.items():
            if half % 2 == 0:
                put(f"fleet/{edge}/robots/{name}/state", _state(edge, name, at, gone), at)
            where = Vector3(gone if name == "rex" else 0.0, 3.0 if name == "ann" else 0.0)
            put(f"cw/{twin}/data/position", encode_report(PoseReport(at, where, Quaternion()), half), at)
        if half % 2 == 0:
            put(f"fleet/{edge}/health", EdgeState(edge, "1", at, gone), at)
        joints = JointReport(at, {"knee": round(gone / 10, 3)})
        put(f"cw/{TWINS['rex']}/data/joint_states", encode_report(joints, half), at)
        put(f"fleet/{edge}/robots/*/description", _description(40.0 if gone < 15 else 20.0), at)
        nightly = ScheduleState("nightly", "round", "every 1 h", gone < 15)
        put(f"fleet/{edge}/schedules", ScheduleAnswer((nightly,)), at)
        if gone in (5.0, 15.0):
            put(f"fleet/{edge}/runs/r1", _run(edge, begins, ended=gone == 15.0), at)
        if gone == 10.0:
            who = Requester(Transport.BUS, "berta", None, proven=True)
            event = Record(at, "rex", EventKind.STOP, "stopped: too close", asker=who)
            file.add(event_message(edge, event), round(at * 1e9))
        file.flush()
    if ends:
        ring.close()
    return ring


def _description(reach):
    """Return what rex is, with a fence as far as this, m, and a refusal that is none of a recording."""
    fence = FenceDescription(inclusion=(((-1.0, -1.0), (reach, -1.0), (reach, 1.0), (-1.0, 1.0)),))
    body = (BodyPart("leg", joint="knee", axis=Vector3(0.0, 1.0), end=Vector3(0.0, 0.0, -1.0)),)
    beep = CommandDescription("beep", refusal=f"until {reach}")
    return RobotDescription("rex", "toy", (beep,), drives=True, fence=fence, body=body)


def _state(edge, name, at, gone):
    """Return the state of a robot after so many seconds."""
    broken = name == "ann" and gone >= 20
    return RobotState(
        name,
        TWINS[name],
        "toy",
        edge,
        at,
        health="fault" if broken else "ok",
        cause="the left wheel is stuck" if broken else "",
        reachable=True,
        emergency_stop=name == "rex" and gone >= 10,
        placement=Placement(PLACED) if name == "rex" else Placement(),
    )


def _run(edge, begins, *, ended):
    """Return the run of a mission."""
    robots = (RunRobot("rex", role="mover"),)
    outcome = "completed" if ended else ""
    phase = "ended" if ended else "step"
    return RunState("r1", edge, "round", phase, "way", begins + 5, by="berta", outcome=outcome, robots=robots)
