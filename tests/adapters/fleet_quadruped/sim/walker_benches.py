"""A simulated machine that walks by itself, in the time of a test."""

from fleet import CanFrame
from fleet_quadruped.any_description import load_body
from fleet_quadruped.frames import FrameDecoder, encode
from fleet_quadruped.robot.description import EXAMPLE
from fleet_quadruped.sim.selfwalk import SimWalker

OWN = load_body(EXAMPLE.with_name("self-walking.yaml"))
DT = 0.02


class Bench:
    """The machine, and what it sent."""

    def __init__(self, walker=OWN):
        self.heard = []
        self.machine = SimWalker(walker, {"a": self.heard.append})
        self.wire = walker.wire
        self._decoder = FrameDecoder((*self.wire.state, *self.wire.slow))
        for frame in self.wire.start:
            self.send(frame)

    def send(self, *frames):
        for frame in frames:
            self.machine.handle_frame("a", frame)
        return self

    def command(self, name):
        return self.send(self.wire.commands[name])

    def drive(self, x=0.0, y=0.0, turn=0.0, seconds=DT):
        """Send a velocity in each cycle."""
        for _ in range(round(seconds / DT)):
            for frame in self.wire.velocity:
                self.send(CanFrame(frame.id, encode(frame, {"x": x, "y": y, "turn": turn})))
            self.machine.advance(DT)
        return self

    def go(self, seconds):
        for _ in range(round(seconds / DT)):
            self.machine.advance(DT)
        return self

    def stand(self):
        return self.command("stand_up").go(1.1)

    def said(self):
        """Return the values of what it sent since the last look."""
        found = {}
        for frame in self.heard:
            found |= self._decoder.decode(frame.id, frame.data) or {}
        self.heard.clear()
        return found

    @property
    def mode(self):
        return self.machine.mode
