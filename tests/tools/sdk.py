"""Ends clients of paho, and of the published SDK around one, without leaving anything open."""

from __future__ import annotations

from typing import Any

import paho.mqtt.client as mqtt


def end(client: Any) -> None:
    """Disconnect a client, or an application of the SDK, and close its sockets.

    paho leaves them to the garbage collector, also the pair by which it wakes its thread. What that finds
    open is a warning in whatever test it comes in.
    """
    client.disconnect()
    while not isinstance(client, mqtt.Client):
        client = getattr(client, "mqtt", None) or getattr(client, "_client", None) or client.client
    client._reset_sockets()
