"""A process that is killed by tests: a schedule starts missions of two robots that obey at once.

Time runs a hundred times as fast. What the robots are told goes to a file. ``kill`` ends the process in the
first start: before it, when the firing is on disk alone, or after it, when nobody has noted it yet.
"""

import asyncio
import json
import os
import signal
import sys
import time
from pathlib import Path

import msgspec

from fleet.config.missions import mission_of
from fleet.host.edge.mission_starter import MissionStarter
from fleet.missions.points import SiteMap
from fleet.missions.roles import RoleCandidate
from fleet.missions.runs import Runs
from fleet.missions.state import Facts
from fleet.missions.store import RunStore as MissionStore
from fleet.model.command import Reply, ReplyStatus, Request
from fleet.model.state import RobotState
from fleet.schedules import runner
from fleet.schedules.model import ScheduleConfig
from fleet.schedules.runner import Schedules
from fleet.schedules.store import FiringStore

SPEED = 100.0
PATROL = {
    "version": 1,
    "roles": {"eye": {"from": "rex"}, "feet": {"from": "max"}},
    "steps": [{"id": "go", "do": {"all": "walk"}}],
    "on_restart": "fail",
}


class FastClock:
    """Unix seconds that pass a hundred times as fast, in every process of a test alike."""

    def __init__(self, began):
        self._began = began

    def monotonic(self):
        return time.monotonic() * SPEED

    def time(self):
        return self._began + (time.time() - self._began) * SPEED


class Robot:
    """A robot that does at once what it is told, and writes it down."""

    def __init__(self, name, file):
        self.name, self._file = name, file
        self._now = RobotState(name, "t", "toy", "yard", 0.0, "ok", reachable=True, battery=80.0)

    def state(self):
        return self._now

    def read(self, kind, payload, *, transport, request_id="", waits=False):
        message = json.loads(payload)
        return Request(lambda answer: self._take(message, request_id, answer))

    def _take(self, message, identity, answer):
        name = message["command"]
        if name in ("join_run", "leave_run"):
            run = message["data"]["run"] if name == "join_run" else ""
            self._now = msgspec.structs.replace(self._now, run=run)
        elif name == "walk":
            self._file.write(f"{identity}\n")
            self._file.flush()
        answer(Reply(name, ReplyStatus.ACCEPTED, done=True))


class KilledIn(MissionStarter):
    """Ends its process in the first start."""

    when = ""

    async def start(self, wanted):
        begun = await super().start(wanted) if self.when == "after" else None
        os.kill(os.getpid(), signal.SIGKILL)
        return begun


async def main(folder, began, trigger, kill):
    runner.EVERY = 0.01
    clock, loop = FastClock(began), asyncio.get_running_loop()
    with (folder / "walked").open("a") as file:
        robots = {name: Robot(name, file) for name in ("rex", "max")}
        store = MissionStore(folder)
        runs = Runs(
            "yard",
            robots,
            candidates=lambda: [
                RoleCandidate(
                    name, "toy", frozenset({"walk"}), Facts(name, "ok", 80.0), run=robot.state().run
                )
                for name, robot in robots.items()
            ],
            allowed=lambda *_: None,
            site=SiteMap(),
            store=store,
            clock=clock,
            soon=loop.call_soon_threadsafe,
            blocker=lambda *_: "",
            edge_of=lambda _: "",
            together=None,
            stop=lambda *_: None,
            on_change=lambda _: None,
        )
        runs.restore_runs()
        KilledIn.when = kill
        starter = KilledIn if kill else MissionStarter
        begins = starter({"patrol": mission_of("patrol", PATROL)}.get, runs, lambda then: then(), clock)
        fires = json.loads(trigger)
        configs = {"round": ScheduleConfig(mission="patrol", late="10 h", busy="queue", **fires)}
        kept = FiringStore(folder)
        kept.seen("round", configs["round"].digest(), began)  # however long it took to come here
        schedules = Schedules(configs, kept, begins, clock=clock, tell=lambda _: None, stopped=dict)
        await schedules.begin()
        work = asyncio.create_task(schedules.run())
        while not work.done():
            runs.poll()
            await asyncio.sleep(0.005)
        await work


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), float(sys.argv[2]), *sys.argv[3:]))
