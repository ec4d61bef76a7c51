"""Edges whose sessions answer what a test says, without a bus."""

import msgspec
import pytest

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.client.edges import Edges
from fleet.errors import Refused
from fleet.model.state import EdgeState, RobotState


class Session(ZenohSession):
    """A session that answers what the test says; ``requests`` are key, payload, time and parameters."""

    def __init__(self, person=""):
        self.person, self.answers, self.requests, self.closed = person, {}, [], False

    def request(self, key, payload, *, timeout, parameters=None):
        self.requests.append((key, payload, timeout, parameters))
        pattern = key.partition("/as/")[0]
        return iter([(at, data) for asked, at, data in self.answers.get(pattern, ()) if asked])

    def answer(self, asked, value, key=None):
        data = value if isinstance(value, bytes) else msgspec.json.encode(value)
        self.answers.setdefault(asked, []).append((True, key or asked, data))

    def has(self, *states):
        for state in states:
            isrobot = isinstance(state, RobotState)
            self.answer(keys.state("*", "*") if isrobot else keys.health("*"), state)
        return self

    def close(self):
        self.closed = True


def robot(name, edge="yard", stamp=1.0, **fields):
    return RobotState(name, f"twin of {name}", "toy", edge, stamp, **fields)


def edge(name="yard", **fields):
    return EdgeState(name, "1.0", 1.0, 1.0, **fields)


def edges_of(*states, unreached=()):
    """Return a single session's edges of these states."""
    return Edges({"yard": Session().has(*states)}, list(unreached))


def names(states):
    return [f"{state.edge}/{state.name}" for state in states]


def refused(call, *arguments):
    """Return the text of a refusal, with its hint."""
    with pytest.raises(Refused) as caught:
        call(*arguments)
    return str(caught.value)
