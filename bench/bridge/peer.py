"""The peer: the SDK's ZenohMqttBridge and a minimal adapter behind it, run as processes.

``python -m bench.bridge.peer bridge PORT BUS QUEUE TWIN...``
``python -m bench.bridge.peer adapter BUS JOURNAL``
"""

import json
import os
import signal
import sys
import threading
import time

import zenoh

from bench.bridge.floor import session


def bridge(port, bus, queue, *twins):
    """Run the SDK's bridge between the broker and the bus that listens on ``bus``."""
    os.environ["CYBERWAVE_BRIDGE_QUEUE_DIR"] = queue
    from cyberwave.zenoh_mqtt.bridge import ZenohMqttBridge  # noqa: PLC0415 - reads the variable on import
    from cyberwave.zenoh_mqtt.config import BridgeConfig  # noqa: PLC0415

    config = BridgeConfig(
        enabled=True,
        twin_uuids=list(twins),
        inbound_topics=["command"],
        outbound_channels=["navigate_status"],
    )
    made = ZenohMqttBridge(
        config, zenoh_session=session(connect=bus), mqtt_host="127.0.0.1", mqtt_port=int(port)
    )
    made.start()
    threading.Event().wait()


def adapter(bus, journal):
    """Listen as the bus, and record each command that arrives, as the puppets do."""
    out = os.open(journal, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)

    def command(sample):
        now = time.monotonic()
        number = json.loads(sample.payload.to_bytes())["data"].get("number", 0)
        line = {"robot": str(sample.key_expr).split("/")[1], "what": "poke", "at": now, "number": number}
        os.write(out, json.dumps(line).encode() + b"\n")

    opened = session(listen=bus)
    kept = opened.declare_subscriber("cw/*/data/command", zenoh.handlers.Callback(command, indirect=False))
    threading.Event().wait()
    kept.undeclare()


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # its threads would keep it running otherwise
    {"bridge": bridge, "adapter": adapter}[sys.argv[1]](*sys.argv[2:])
