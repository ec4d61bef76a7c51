"""Messages in at QoS 1, 20,000 a second offered to 50 twins: CPU per message.

Our edge decodes each as a velocity, admits it and drives a robot. Peer and floor put the bytes on the bus.
"""

import json
import time

from bench.bridge.sides import SIDES, side
from bench.common import cpu_seconds, line, mosquitto
from tests.tools.mqtt import Mqtt

OFFERED = 20_000  # messages per second
SECONDS = 4
BURST = 0.01  # s


def measure(name):
    """Return the CPU per message (us), and the seconds until all were processed."""
    with mosquitto() as port, side(name, port) as running, Mqtt(port, "sender") as sender:
        before, began, sent = cpu_seconds(running.pid), time.monotonic(), 0
        while sent < OFFERED * SECONDS:
            message = {"command": "move_forward", "source_type": "tele", "data": {"linear_x": 1.0}}
            payload = json.dumps(message | {"timestamp": time.time()}).encode()
            due = min(int((time.monotonic() - began) * OFFERED) + 1, OFFERED * SECONDS)
            twins = (running.twins[each % len(running.twins)] for each in range(sent, due))
            sender.send(
                b"".join(sender.packet(f"cyberwave/twin/{twin}/command", payload, 1) for twin in twins)
            )
            sent = due
            time.sleep(BURST)
        _idle(running.pid)
        return (cpu_seconds(running.pid) - before) / sent * 1e6, time.monotonic() - began


def _idle(pid):
    """Wait until a process has used almost no CPU for three seconds in a row."""
    used, quiet = cpu_seconds(pid), 0
    while quiet < 3:
        time.sleep(1)
        used, before = cpu_seconds(pid), used
        quiet = quiet + 1 if used - before < 0.1 else 0


def run():
    results = {name: measure(name) for name in SIDES}
    for name, (cost, took) in results.items():
        line(
            f"in, {OFFERED} /s offered for {SECONDS} s: {name}", f"{cost:.0f} us", f"done after {took:.1f} s"
        )
    line("CPU against the peer", f"{results['fleet'][0] / results['peer'][0]:.2f} x", "aim: at most 0.5")
