"""Test helpers for the published SDK: a back end for it, driving with it, and its clean shutdown."""

from __future__ import annotations

import contextlib
import json
import threading
import uuid
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import paho.mqtt.client as mqtt

from tests.tools.waiting import wait_until

Publish = Callable[[str, dict[str, Any]], None]


class Backend(BaseHTTPRequestHandler):
    """The one thing that the SDK wants of a back end here: navigation goals are put on the twin's topic."""

    server: Server

    def do_POST(self) -> None:
        """Publish a goal and say that it is queued."""
        goal = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        goal["action_id"] = uuid.uuid4().hex
        twin = self.path.split("/")[4]
        self.server.publish(f"cyberwave/twin/{twin}/navigate/command", goal)
        answer = json.dumps({"action_id": goal["action_id"], "status": "queued"}).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(answer)))
        self.end_headers()
        self.wfile.write(answer)

    def log_message(self, *_: object) -> None:
        """Say nothing."""


class Server(ThreadingHTTPServer):
    """A back end on a free port."""

    def __init__(self, publish: Publish) -> None:
        super().__init__(("127.0.0.1", 0), Backend)
        self.publish = publish


@contextlib.contextmanager
def back_end(publish: Publish) -> Iterator[str]:
    """Run what stands for the back end; gives its address."""
    with Server(publish) as server:
        serving = threading.Thread(target=server.serve_forever)
        serving.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        serving.join()


def drive(verb: Callable[[], object], reached: Callable[[], bool], stops: Callable[[], int]) -> None:
    """Give a verb until something is reached; a busy computer cuts a burst of velocities short.

    ``stops``: the number of stops that were answered so far. Each burst ends in one, which would end the next
    burst, too, if it came late; the last one is answered when this returns.
    """
    given = stops()

    def done() -> bool:
        nonlocal given
        if not reached() and stops() >= given:
            given += 1
            verb()
        return reached()

    wait_until("what the SDK drives to", done)
    wait_until("the stop after it", lambda: stops() >= given)


def end(client: Any) -> None:
    """Disconnect a client, or an application of the SDK, and close its sockets.

    paho leaves them to the garbage collector, also the pair by which it wakes its thread. What that finds
    open is a warning in whatever test it comes in.
    """
    client.disconnect()
    while not isinstance(client, mqtt.Client):
        client = getattr(client, "mqtt", None) or getattr(client, "_client", None) or client.client
    client._reset_sockets()
