"""What tests do with the published SDK: drive with it, and end it without leaving anything open."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import paho.mqtt.client as mqtt

from fleet.testing.waiting import wait_until


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
