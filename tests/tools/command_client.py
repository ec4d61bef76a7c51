"""Cloud client that sends numbered commands to puppets and records the outcome of each.

Unanswered commands are repeated verbatim and with the same correlation data, as a careful client does. So no
command is lost silently, and executions can be counted.
"""

from __future__ import annotations

import json
import threading
import time
import uuid
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from tests.tools.mqtt import Mqtt
from tests.tools.promises import Event, What

PUPPETS = Path(__file__).parent / "plugins"
"""The folder to name under ``plugins`` in fleet.yaml, for robots with ``adapter: puppet``."""
SPEED_STEP = 1000.0  # a velocity carries its number: that many numbers a m/s
MOVES = frozenset({"lunge", "drive"})


class Ask(msgspec.Struct):
    """One thing that was asked, whether it was answered, why refused; ``sent`` counts its messages."""

    robot: str
    number: int
    topic: str
    payload: bytes
    stamp: float
    sent: int = 0
    answered: bool = False
    refusal: str = ""


class CommandClient:
    """Asks over its own connection to the broker; ``twins``: by robot name."""

    def __init__(self, port: int, twins: Mapping[str, str], *, name: str = "asker") -> None:
        self._twins = dict(twins)
        self._name = name
        self._life = uuid.uuid4().hex  # an edge remembers what it was asked, also before it was restarted
        self._lock = threading.Lock()
        self._events: list[Event] = []
        self.asks: dict[int, Ask] = {}
        inboxes = [f"{self._root(robot)}/command/{name}/response" for robot in self._twins]
        self.mqtt = Mqtt(port, name, topics=inboxes, took=self._took)

    def ask(self, robot: str, command: str = "poke") -> Ask:
        """Ask a robot once for something discrete."""
        number = len(self.asks) + 1
        message = _message(command, {"number": number})
        ask = Ask(robot, number, f"{self._root(robot)}/command", message, time.monotonic())
        self.asks[number] = ask
        self._send(ask)
        return ask

    def drive(self, robot: str) -> None:
        """Send a velocity, QoS 1; nobody answers it."""
        number = len(self.asks) + 1
        message = _message("move_forward", {"linear_x": number / SPEED_STEP})
        ask = Ask(robot, number, f"{self._root(robot)}/command", message, time.monotonic(), 1, answered=True)
        self.asks[number] = ask
        self.mqtt.publish(ask.topic, ask.payload, qos=1)

    def unanswered(self) -> list[Ask]:
        """Return what was not answered yet."""
        return [ask for ask in self.asks.values() if not ask.answered]

    def retry_until_accepted(self) -> None:
        """Ask again for what was not answered."""
        for ask in self.unanswered():
            self._send(ask)

    def events(self) -> list[Event]:
        """Return what was noted."""
        with self._lock:
            return list(self._events)

    def close(self) -> None:
        """End the connection."""
        self.mqtt.close()

    def _root(self, robot: str) -> str:
        """Return the beginning of a robot's topics."""
        return f"cyberwave/twin/{self._twins[robot]}"

    def _send(self, ask: Ask) -> None:
        """Send an ask; the broker says whether anybody is there to take it."""
        ask.sent += 1
        self._note(ask, What.RECEIVED)
        self.mqtt.publish(
            ask.topic,
            ask.payload,
            qos=1,
            response_topic=f"{ask.topic}/{self._name}/response",
            correlation_data=f"{self._life} {ask.number}".encode(),
        )

    def _note(self, ask: Ask, what: What, *, ok: bool = True) -> None:
        """Note an event."""
        with self._lock:
            self._events.append(
                Event(time.monotonic(), what, ask.robot, str(ask.number), stamp=ask.stamp, ok=ok)
            )

    def _took(self, packet: Any, _now: float) -> None:
        """Take a reply; on the connection's thread."""
        ask = self.asks[int(packet.correlation_data.split()[1])]
        ask.answered = True
        reply = json.loads(packet.payload)
        taken = reply["status"] == "accepted"
        ask.refusal = "" if taken else reply.get("reason", reply["status"])
        self._note(ask, What.REPLIED, ok=taken)


def _message(command: str, data: Mapping[str, object]) -> bytes:
    """Return a command message of a person at a remote control."""
    return json.dumps(
        {"command": command, "source_type": "tele", "timestamp": time.time(), "data": data}
    ).encode()


def executed(journal: Path, asks: Mapping[int, Ask]) -> list[Event]:
    """Return what the puppets did, by their journal and by what they were asked."""
    return [event for line in _lines(journal) if (event := _execution(line, asks)) is not None]


def _lines(journal: Path) -> Iterable[Mapping[str, object]]:
    """Yield the lines of a journal; the last one of a process that was killed may not be whole."""
    for text in journal.read_text().splitlines():
        try:
            yield json.loads(text)
        except json.JSONDecodeError:
            continue


def _execution(line: Mapping[str, Any], asks: Mapping[int, Ask]) -> Event | None:
    """Return the event of one line, None for a stop, a velocity of zero, and what others asked."""
    number = line.get("number", round(line.get("x", 0.0) * SPEED_STEP))
    if not number:
        return None
    ask = asks.get(number)
    if ask is None:
        return None
    moves = line["what"] in MOVES
    return Event(line["at"], What.EXECUTED, line["robot"], str(number), stamp=ask.stamp, moves=moves)


def counted(events: Sequence[Event]) -> dict[str, int]:
    """Return how often each ask was executed."""
    counts: dict[str, int] = {}
    for event in events:
        if event.what is What.EXECUTED:
            counts[event.ask] = counts.get(event.ask, 0) + 1
    return counts
