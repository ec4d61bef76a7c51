"""From a command in the cloud to the adapter, while 5,000 messages a second flow out.

The broker and who sends the commands have the processors first; what the broker answers him nobody reads, for
that would take a processor from who is measured just when the command comes. No processor sleeps meanwhile.
The sides take turns: a shared computer changes its pace within a minute.
"""

import contextlib
import json
import random
import time

import mqtt5

from bench.bridge.sides import SIDES, side, source
from bench.common import at_once, awake, bare_client, line, listener, mosquitto, quantiles

ROUNDS = 3
COMMANDS = 200  # a round
PAUSE = 0.01  # s
OUT = 5000  # messages a second
RATE = OUT / 50 / 4  # Hz of each of our 50 robots' four topics


def measure(name):
    """Return how long each command was under way, s."""
    with contextlib.ExitStack() as stack:
        port = stack.enter_context(mosquitto())
        running = stack.enter_context(side(name, port, rate=RATE if name == "fleet" else 0.0))
        if name != "fleet":
            stack.enter_context(source(running, OUT))
        sender = stack.enter_context(bare_client(port, "sender"))
        stack.enter_context(awake())
        time.sleep(2)
        at_once()
        at_once(listener(port).pid)
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
