"""Stopping time and distance of each kind of simulated robot.

Measured from the moment a stop is requested, or the last velocity is sent, to the last movement in the
robot's own pose reports.
"""

import json
import math
import time
from pathlib import Path

from bench.common import fleet, line, mosquitto, twin_of, wait_for
from fleet.bus import keys
from fleet.bus.bus import join_control
from fleet.bus.settings import BusSettings
from fleet.wire.databus import decode_report

TIMES = 3
STILL = 0.1  # m/s; anything slower is at rest (a hovering aircraft is never quite still)
SPAN = 0.25  # s over which a speed is determined
KINDS = (
    ("px4 at 5 m/s", {"adapter": "mavlink", "link": "sim:px4"}, 5.0, ("takeoff", {"altitude": 10})),
    ("px4 at 2 m/s", {"adapter": "mavlink", "link": "sim:px4"}, 2.0, ("takeoff", {"altitude": 10})),
    (
        "ardupilot at 5 m/s",
        {"adapter": "mavlink", "link": "sim:ardupilot"},
        5.0,
        ("takeoff", {"altitude": 10}),
    ),
    (
        "ardupilot at 2 m/s",
        {"adapter": "mavlink", "link": "sim:ardupilot"},
        2.0,
        ("takeoff", {"altitude": 10}),
    ),
    ("dog at 0.5 m/s", {"adapter": "quadruped", "link": "sim:auto"}, 0.5, ("stand_up", {})),
    (
        "wheeled base at 0.35 m/s",
        {"adapter": "ugv", "profile": "waveshare-beast", "link": "sim:waveshare-beast"},
        0.35,
        None,
    ),
)
METHODS = ("stop", "emergency_stop", "silence")


class RobotClient:
    """One robot on the bus: requests to it, and the positions it reports."""

    def __init__(self, bus_session, name):
        self.bus_session, self.name, self.twin = bus_session, name, twin_of(name)
        self.poses = []
        bus_session.subscribe(f"cw/{self.twin}/data/position", self._seen)

    def _seen(self, _key, sample):
        at = decode_report("position", sample).position
        self.poses.append((time.monotonic(), (at.x, at.y, at.z)))

    def request(self, command, data=None, *, wait=False):
        """Send a command and return the last reply."""
        payload = json.dumps({"command": command, "data": data or {}, "source_type": "sim_tele"}).encode()
        parameters = {"kind": "command", "wait": "1" if wait else "0"}
        key = keys.command("bench", self.name)
        found = list(self.bus_session.request(key, payload, timeout=90.0, parameters=parameters))
        return json.loads(found[-1][1]) if found else {}

    def drive(self, speed, seconds):
        """Drive forward for ``seconds``."""
        for _ in range(round(seconds / 0.05)):
            self.bus_session.put(
                f"cw/{self.twin}/data/commands/velocity", json.dumps({"linear_x": speed}).encode()
            )
            time.sleep(0.05)

    def speed(self, at):
        """Return the speed over the half second before ``at``, m/s."""
        span = [pose for pose in self.poses if at - 0.5 <= pose[0] <= at]
        return math.dist(span[0][1], span[-1][1]) / (span[-1][0] - span[0][0])

    def standstill(self, since):
        """Return the seconds to the last movement, the farthest distance (m), and the speed before."""
        time.sleep(8.0)
        poses = [pose for pose in self.poses if pose[0] >= since]
        moved = since
        for at, one in poses:
            later, other = next((pose for pose in poses if pose[0] >= at + SPAN), (at, one))
            if later > at and math.dist(one, other) / (later - at) > STILL:
                moved = later
        farthest = max(math.dist(poses[0][1], one) for _, one in poses)
        return moved - since, farthest, self.speed(since)


def run(rows=()):
    for kind, fields, speed, begin in KINDS:
        if not rows or kind.split()[0] in rows:
            measure(kind, fields, speed, begin)


def measure(kind, fields, speed, begin):
    """Measure one kind of robot, each way of stopping several times."""
    robot = {"name": "robot", "twin": twin_of("robot"), **fields}
    with mosquitto() as broker, fleet([robot], broker) as edge:
        edge.all_healthy(1)
        bus_session = join_control(BusSettings("bench"), Path(edge.runtime))
        watch = RobotClient(bus_session, "robot")
        time.sleep(8.0)
        for method in METHODS:
            found = [once(watch, method, speed, begin) for _ in range(TIMES)]
            worst = f"{max(each[0] for each in found):.2f} s, {max(each[1] for each in found):.2f} m"
            usual = sorted(found)[len(found) // 2]
            figure = f"{usual[0]:.2f} s, {usual[1]:.2f} m"
            line(f"{kind}: {method}", figure, f"at most {worst}; from {usual[2]:.2f} m/s")
        if kind.startswith(("px4", "ardupilot")):
            watch.request("land")
        bus_session.close()


def once(watch, method, speed, begin):
    """Drive and stop; return the time (s) and distance (m) to standstill, and the speed before."""
    watch.request("release_emergency_stop")
    if begin is not None:
        wait_for(lambda: watch.request(*begin, wait=True).get("done"), within=120.0)
    watch.drive(speed, 4.0)
    since = time.monotonic()
    if method == "emergency_stop":
        watch.bus_session.put(keys.stop("bench"), b"[]", urgent=True)
    elif method == "stop":
        watch.request("stop")
    return watch.standstill(since)
