"""A process of schedules that is killed by tests: time runs a hundred times as fast; starts go to a file."""

import asyncio
import os
import sys
import time
from pathlib import Path

from fleet.schedules import runner
from fleet.schedules.model import ScheduleConfig
from fleet.schedules.runner import Schedules, StartResult
from fleet.schedules.store import FiringStore

SPEED = 100.0


class FastClock:
    """Unix seconds that pass a hundred times as fast, in every process of a test alike."""

    def __init__(self, began):
        self._began = began

    def monotonic(self):
        return time.monotonic() * SPEED

    def time(self):
        return self._began + (time.time() - self._began) * SPEED


class Runs:
    """Starts missions as the mission runner does: the key is on disk with the run, then it is answered."""

    def __init__(self, path):
        self._path = path

    async def start(self, wanted):
        run = await self.known(wanted.key)
        if not run:
            await asyncio.sleep(0.002)
            with self._path.open("a") as file:
                file.write(f"{wanted.key}\n")
                file.flush()
                os.fsync(file.fileno())
            run = wanted.key
        await asyncio.sleep(0.002)
        return StartResult(run)

    async def known(self, key):
        lines = self._path.read_text().splitlines() if self._path.exists() else []
        return key if key in lines else ""


async def main(folder, began):
    runner.EVERY = 0.01
    configs = {
        "often": ScheduleConfig(mission="m", every=10.0, late="1 h"),
        "seldom": ScheduleConfig(mission="m", every=70.0, late="20 s", missed="once"),
    }
    events = (folder / "events").open("a")

    def tell(event):
        events.write(f"{event.data['schedule']} {event.data.get('due')} {event.text}\n")
        events.flush()

    schedules = Schedules(
        configs, FiringStore(folder), Runs(folder / "runs"), clock=FastClock(began), tell=tell, stopped=dict
    )
    await schedules.begin()
    await schedules.run()


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), float(sys.argv[2])))
