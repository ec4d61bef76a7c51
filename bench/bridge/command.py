"""Latency from a cloud command to the adapter, while 5,000 messages a second flow out.

The broker and the command sender have real-time priority. Nobody reads the broker's replies to the sender:
reading would take a processor from the candidate just when the command arrives. No processor enters a deep
sleep state. The candidates take turns, because the speed of a shared computer varies within a minute.
"""

import contextlib
import json
import random
import time

import mqtt5

from bench.bridge.sides import SIDES, side, source
from bench.common import bare_client, line, listener, mosquitto, quantiles, set_realtime, without_deep_sleep

ROUNDS = 3
COMMANDS = 200  # per round
PAUSE = 0.01  # s
OUT = 5000  # messages per second
RATE = OUT / 50 / 4  # Hz of each of the four topics of our 50 robots


def measure(name):
    """Return the latency of each command that arrived, in seconds."""
    with contextlib.ExitStack() as stack:
        port = stack.enter_context(mosquitto())
        running = stack.enter_context(side(name, port, rate=RATE if name == "fleet" else 0.0))
        if name != "fleet":
            stack.enter_context(source(running, OUT))
        sender = stack.enter_context(bare_client(port, "sender"))
        stack.enter_context(without_deep_sleep())
        time.sleep(2)
        set_realtime()
        set_realtime(listener(port).pid)
        sent = {}
        for number in range(1, COMMANDS + 1):
            message = {"command": "poke", "source_type": "tele", "data": {"number": number}}
            payload = json.dumps(message | {"timestamp": time.time()}).encode()
            topic = f"cyberwave/twin/{running.twins[number % len(running.twins)]}/command"
            packet = mqtt5.PublishPacket(topic, payload, qos=mqtt5.QoS(1), packet_id=number).write()
            sent[number] = time.monotonic()
            sender.sendall(packet)
            time.sleep(random.uniform(0.5, 1.5) * PAUSE)
        time.sleep(1)
        arrived = running.executed()
    return [arrived[number] - at for number, at in sent.items() if number in arrived]


def run():
    results = {name: [] for name in SIDES}
    for _ in range(ROUNDS):
        for name in SIDES:
            results[name] += measure(name)
    for name, taken in results.items():
        p50, p99 = (quantile * 1e6 for quantile in quantiles(taken))
        line(f"command while {OUT} /s flow out: {name}", f"{p50:.0f} / {p99:.0f} us", f"{len(taken)} came")
    (ours, our99), (peer, peer99) = quantiles(results["fleet"]), quantiles(results["peer"])
    line("p50 against the peer", f"{ours / peer:.2f} x", "aim: at most 0.65")
    line("p99 against the peer", f"{our99 / peer99:.2f} x", "aim: at most 0.65")
