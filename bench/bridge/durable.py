"""Durable messages out at QoS 1 from 50 twins, at the maximum rate: CPU per message."""

from bench.bridge.sides import SIDES, carried
from bench.common import line, mosquitto

OFFERED = 10_000  # messages per second


def run():
    results = {}
    for name in SIDES:
        with mosquitto() as port:
            results[name] = carried(name, port, port, offered=OFFERED, seconds=8)
    for name, (rate, cost, _) in results.items():
        line(f"durable out, {OFFERED} /s offered: {name}", f"{rate:.0f} /s, {cost:.0f} us")
    (_, ours, _), (_, peer, _), (_, floor, _) = (results[name] for name in SIDES)
    line("CPU for a message against the peer", f"{ours / peer:.2f} x", "aim: at most 0.2")
    line("CPU for a message against the floor", f"{ours / floor:.2f} x", "aim: at most 3")
