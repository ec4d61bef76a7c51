import pytest
from hypothesis import settings

from fleet.missions.engine import Engine
from fleet.missions.program import Act, Do, Program
from fleet.missions.state import (
    Begin,
    BeginTogether,
    Ended,
    Facts,
    PartOutcome,
    Prepare,
    Replied,
    RunMember,
    Start,
    Tick,
)
from tests.fleet.missions.yard import Yard

SOAK = 10_000
"""Lives of a run that are played with ``--soak``."""
ROLES = {"kestrel": "eye", "beast": "feet", "rover": "feet"}


class Play:
    """A run that is played event by event; time is moved by hand."""

    def __init__(self, *steps, robots=ROLES, plays=None, spares=None, **options):
        self.now = 0.0
        self.effects = []
        spares = spares or {}
        quorum = options.pop("quorum", {"eye": 1, "feet": 1})
        self.program = Program("patrol", steps, quorum, **options)
        members = [
            RunMember(robot, role, at, (plays or {}).get(robot, {}))
            for at, (robot, role) in enumerate(robots.items())
        ]
        members += [
            RunMember(robot, role, 0, ours=False, within=False, spare=True) for robot, role in spares.items()
        ]
        self.engine = Engine("run", self.program, members)
        for robot in (*robots, *spares):
            self.handle(Facts(robot, "ok", 80.0, (0.0, 0.0, 0.0)))
        self.handle(Start())

    def handle(self, event):
        self.effects += self.engine.handle(event, self.now)
        return self

    def wait(self, seconds):
        """Let time pass."""
        self.now += seconds
        return self.handle(Tick())

    def begun(self):
        """Return what was begun: robot and words, in order."""
        parts = [
            part
            for each in self.effects
            for part in (each.parts if isinstance(each, BeginTogether) else (getattr(each, "part", None),))
            if isinstance(each, Begin | BeginTogether)
        ]
        return [(part.robot, part.act.words) for part in parts]

    def of(self, kind):
        return [each for each in self.effects if isinstance(each, kind)]

    def reply(self, robot, outcome=PartOutcome.DONE, reason="so it was", words=None):
        """Let a robot say how what it does ended."""
        parts = [part for part in self.engine.robots.active() if part.robot == robot]
        found = [part for part in parts if words in (None, part.act.words)]
        assert found, f"{robot} does nothing: {self.begun()}"
        return self.handle(Replied(found[0].identity, outcome, reason))

    def stands(self, *robots):
        """Let robots be seen standing."""
        for robot in robots:
            self.reply(robot, words="stop")
        return self

    def outcomes(self):
        return {robot: member.outcome for robot, member in self.engine.robots.members.items()}

    @property
    def ended(self):
        """How it ended; None while it has not."""
        found = self.of(Ended)
        assert len(found) <= 1
        return found[0].outcome if found else None

    @property
    def preparing(self):
        return [each.robot for each in self.of(Prepare)]


def do(step="go", *, undo=None, **options):
    """Return a step in which all robots go, and land to undo it."""
    acts = options.pop("acts", {"all": (Act("goto", [1, 1], timeout=60.0),)})
    return Do(step, acts, undo=undo or {}, **options)


@pytest.fixture
def play():
    return Play


@pytest.fixture
def yard(tmp_path):
    made = Yard(tmp_path)
    yield made
    made.store.close()


def pytest_collection_modifyitems(config, items):
    """Play more lives in a soak: the settings of a state machine are its class's."""
    if config.getoption("--soak"):
        for machine in {item.cls for item in items if hasattr(item.cls, "settings")}:
            machine.settings = settings(machine.settings, max_examples=SOAK)
