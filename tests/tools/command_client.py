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


class RobotRequest(msgspec.Struct):
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
        self.requests: dict[int, RobotRequest] = {}
        inboxes = [f"{self._root(robot)}/command/{name}/response" for robot in self._twins]
        self.mqtt = Mqtt(port, name, topics=inboxes, took=self._took)

    def request(self, robot: str, command: str = "poke") -> RobotRequest:
        """Ask a robot once for something discrete."""
        number = len(self.requests) + 1
        message = _message(command, {"number": number})
        request = RobotRequest(robot, number, f"{self._root(robot)}/command", message, time.monotonic())
        self.requests[number] = request
        self._send(request)
        return request

    def drive(self, robot: str) -> None:
        """Send a velocity, QoS 1; nobody answers it."""
        number = len(self.requests) + 1
        message = _message("move_forward", {"linear_x": number / SPEED_STEP})
        request = RobotRequest(
            robot, number, f"{self._root(robot)}/command", message, time.monotonic(), 1, answered=True
        )
        self.requests[number] = request
        self.mqtt.publish(request.topic, request.payload, qos=1)

    def unanswered(self) -> list[RobotRequest]:
        """Return what was not answered yet."""
        return [request for request in self.requests.values() if not request.answered]

    def retry_until_accepted(self) -> None:
        """Ask again for what was not answered."""
        for request in self.unanswered():
            self._send(request)

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

    def _send(self, request: RobotRequest) -> None:
        """Send an ask; the broker says whether anybody is there to take it."""
        request.sent += 1
        self._note(request, What.RECEIVED)
        self.mqtt.publish(
            request.topic,
            request.payload,
            qos=1,
            response_topic=f"{request.topic}/{self._name}/response",
            correlation_data=f"{self._life} {request.number}".encode(),
        )

    def _note(self, request: RobotRequest, what: What, *, ok: bool = True) -> None:
        """Note an event."""
        with self._lock:
            self._events.append(
                Event(time.monotonic(), what, request.robot, str(request.number), stamp=request.stamp, ok=ok)
            )

    def _took(self, packet: Any, _now: float) -> None:
        """Take a reply; on the connection's thread."""
        request = self.requests[int(packet.correlation_data.split()[1])]
        request.answered = True
        reply = json.loads(packet.payload)
        taken = reply["status"] == "accepted"
        request.refusal = "" if taken else reply.get("reason", reply["status"])
        self._note(request, What.REPLIED, ok=taken)


def _message(command: str, data: Mapping[str, object]) -> bytes:
    """Return a command message of a person at a remote control."""
    return json.dumps(
        {"command": command, "source_type": "tele", "timestamp": time.time(), "data": data}
    ).encode()


def executed(journal: Path, requests: Mapping[int, RobotRequest]) -> list[Event]:
    """Return what the puppets did, by their journal and by what they were asked."""
    return [event for line in _lines(journal) if (event := _execution(line, requests)) is not None]


def _lines(journal: Path) -> Iterable[Mapping[str, object]]:
    """Yield the lines of a journal; the last one of a process that was killed may not be whole."""
    for text in journal.read_text().splitlines():
        try:
            yield json.loads(text)
        except json.JSONDecodeError:
            continue


def _execution(line: Mapping[str, Any], requests: Mapping[int, RobotRequest]) -> Event | None:
    """Return the event of one line, None for a stop, a velocity of zero, and what others asked."""
    number = line.get("number", round(line.get("x", 0.0) * SPEED_STEP))
    if not number:
        return None
    request = requests.get(number)
    if request is None:
        return None
    moves = line["what"] in MOVES
    return Event(line["at"], What.EXECUTED, line["robot"], str(number), stamp=request.stamp, moves=moves)


def counted(events: Sequence[Event]) -> dict[str, int]:
    """Return how often each ask was executed."""
    counts: dict[str, int] = {}
    for event in events:
        if event.what is What.EXECUTED:
            counts[event.request] = counts.get(event.request, 0) + 1
    return counts
