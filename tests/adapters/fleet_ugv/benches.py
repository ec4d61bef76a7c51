"""An adapter of a base, and the simulated base behind its link."""

import asyncio

from fleet import Level
from fleet.host.robot.adapter_factory import capabilities, create_adapter, start_command
from fleet.model.command import Command
from fleet.testing.robot import RecordingRobot, serve
from fleet_ugv import UgvAdapter


class Bench:
    """An adapter, and a simulated base behind a link in memory; the test turns the clock of both."""

    def __init__(self, config, machine, board, state=None):
        self.board = board
        self.machine = machine
        self.robot = RecordingRobot()
        self.robot.state = {} if state is None else state
        self.adapter = create_adapter(UgvAdapter, config, self.robot)
        self.run = asyncio.create_task(serve(self.adapter))
        self._heard = 0

    async def pass_time(self, seconds):
        """Let both live, 20 ms at a time."""
        for _ in range(round(seconds / 0.02)):
            now = self.robot.clock.monotonic() - 1000.0
            self._say(self.board.step(now))
            await asyncio.sleep(0)
            self.robot.advance(0.02)
            for data in self.machine.heard[self._heard :]:
                self._say(self.board.receive(data, now))
            self._heard = len(self.machine.heard)
            await asyncio.sleep(0)

    def _say(self, data):
        if data:
            self.machine.say(data)

    async def ready(self):
        for _ in range(200):
            await self.pass_time(0.02)
            if self.health == Level.OK:
                return self
        raise AssertionError(self.robot.healths[-1:])

    @property
    def health(self):
        return self.robot.healths[-1].level if self.robot.healths else None

    def last(self, kind):
        return self.robot.reports_of(kind)[-1]

    def motion(self):
        """Return what was written since the last look, and forget it."""
        heard, self.machine.heard[:] = list(self.machine.heard), []
        self._heard = 0
        return b"".join(heard)

    async def do(self, name, **data):
        await start_command(self.adapter, capabilities(UgvAdapter).commands[name], Command(name, data))

    async def end(self):
        self.run.cancel()
        await asyncio.gather(self.run, return_exceptions=True)
