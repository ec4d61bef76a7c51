"""Whatever is asked of a robot, in whatever order, late, twice or by strangers: the promises hold."""

import asyncio
from typing import Any, Literal

from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.adapter import Adapter, AdapterConfig
from fleet.commands import command
from fleet.host.journal.journal import RobotJournal
from fleet.host.requests.receipt import Receipt
from fleet.host.robot.adapter_factory import capabilities
from fleet.host.robot.controller import RobotController
from fleet.host.safety.emergency_stop import RELEASE
from fleet.model.command import Command, Origin, Setpoint, Transport
from fleet.model.geometry import Vector3, Velocity
from fleet.testing.clock import ManualClock
from fleet.testing.robot import RecordingRobot
from tests.tools.promises import Event, Rules, What, broken

RULES = Rules(max_age=5.0)
VELOCITIES = Rules(max_age=0.5)
STEPS = st.tuples(
    st.sampled_from(["step", "step", "drive", "drive", "repeat", "emergency_stop", "stop", RELEASE]),
    st.sampled_from([0.0, 0.1, 0.6, 6.0, 600.0]),  # how old the message is, s
    st.sampled_from(["tele", "tele", "tele", "edge", None]),
    st.sampled_from([0.0, 0.0, 0.2, 4.0]),  # s until the next one
)


class RexConfig(AdapterConfig):
    adapter: Literal["rex"] = "rex"


class Rex(Adapter[RexConfig]):
    Config = RexConfig
    failsafe = "it moves nothing"

    def __init__(self, config, life):
        super().__init__(config, RecordingRobot())
        self.life = life

    def drive(self, velocity):
        if velocity.linear.x:
            self.life.note(What.EXECUTED, f"drive-{round(velocity.linear.x * 1000)}", moves=True)

    async def stop(self, reason):
        """Stand."""

    def halt(self):
        """Stand at once."""

    @command("step")
    async def step(self, number: int):
        """Move once."""
        await asyncio.sleep(0)
        self.life.note(What.EXECUTED, f"step-{number}", moves=True)


class Life:
    """The controller of one robot, and a journal of all that happens at it."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.events: list[Event] = []
        self.stamps: dict[str, float] = {}
        self.crashes: list[Exception] = []
        config = RexConfig(name="rex", twin="6f0c9a1e-0000-4000-8000-000000000001", clock_skew=0.0)
        self.controller = RobotController(
            config,
            capabilities(Rex),
            publish=lambda _: None,
            crashed=self.crashes.append,
            restart=lambda: None,
            journal=RobotJournal(),
            clock=self.clock,
        )
        admission = self.controller._admission
        for name in ("command", "setpoint"):
            setattr(admission, name, self._watched(getattr(admission, name)))
        self.controller.attach(Rex(config, self))
        self.controller.found()

    def _watched(self, judge):
        def judged(request, **more):
            refusal = judge(request, **more)
            name = request.id if isinstance(request, Command) else request.name
            if refusal is None and name:
                self.note(What.ADMITTED, name)
            return refusal

        return judged

    def note(self, what: What, request: str = "", **fields: Any) -> None:
        at = self.clock.monotonic() + len(self.events) * 1e-7
        self.events.append(Event(at, what, "rex", request, stamp=self.stamps.get(request), **fields))

    def request(self, kind: str, number: int, age: float, source: str | None) -> None:
        origin, stamp = Origin(Transport.CLOUD, source, "anna"), self.clock.time() - age
        name = f"{kind}-{number}"
        if kind in ("step", "drive"):
            self.stamps.setdefault(name, self.clock.monotonic() - age)
            self.note(What.RECEIVED, name)
        what = {
            "step": Command("step", {"number": number}, origin, name, stamp),
            "drive": Setpoint(Velocity(Vector3(number / 1000)), name, origin=origin, stamp=stamp),
        }.get(kind, Command(kind, origin=origin, stamp=stamp))
        self.controller.receive(what, Receipt(name, lambda reply: self._replied(kind, name, ok=reply.ok)))
        if kind == "emergency_stop":
            self.note(What.STOPPED)

    def _replied(self, kind: str, name: str, *, ok: bool) -> None:
        if kind == RELEASE and ok:
            self.note(What.RELEASED)
        elif kind in ("step", "drive"):
            self.note(What.REPLIED, name, ok=ok)


async def live(steps) -> list[Event]:
    """Ask everything; return what happened."""
    life = Life()
    last = ("step", 1)
    for number, (kind, age, source, pause) in enumerate(steps, 1):
        kind, number = last if kind == "repeat" else (kind, number)  # noqa: PLW2901
        life.request(kind, number, age, source)
        last = (kind, number) if kind == "step" else last
        for _ in range(4 if pause else 0):
            await asyncio.sleep(0)
        life.clock.advance(pause)
    for _ in range(10):
        await asyncio.sleep(0)
    assert life.crashes == []
    return life.events


@settings(max_examples=150, deadline=None)
@given(st.lists(STEPS, max_size=15))
def test_no_order_of_asks_breaks_a_promise(steps):
    events = asyncio.run(live(steps))
    assert broken(events, RULES) == []
    assert broken([event for event in events if event.request.startswith("drive")], VELOCITIES) == []


def test_the_checker_sees_what_happens_here():
    events = asyncio.run(live([("step", 0.0, "tele", 0.2), ("drive", 0.1, "tele", 0.0)]))
    assert [event.what for event in events if event.request == "step-1"] == [
        What.RECEIVED,
        What.ADMITTED,
        What.EXECUTED,
        What.REPLIED,
    ]
    assert [event.what for event in events if event.request == "drive-2"][-2:] == [
        What.EXECUTED,
        What.REPLIED,
    ]
