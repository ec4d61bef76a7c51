"""Durable messages out at QoS 1 from 50 twins: CPU per message, at 10,000 a second and at half of that.

The aims are for the higher rate, which our edge and the floor just carry on two processors. Above what a
candidate carries, its CPU also pays for the messages that it has taken and not delivered yet; our edge writes
them to disk. At the lower rate a message costs more, because fewer share a turn of the loop.
"""

from bench.bridge.sides import SIDES, carried
from bench.common import line, mosquitto

HALF, MAXIMUM = 5_000, 10_000  # messages per second


def run():
    for offered in (HALF, MAXIMUM):
        costs = {}
        for name in SIDES:
            with mosquitto() as port:
                rate, costs[name], _ = carried(name, port, port, offered=offered, seconds=8)
            line(f"durable out, {offered} /s offered: {name}", f"{rate:.0f} /s, {costs[name]:.0f} us")
        aims = ("aim: at most 0.2", "aim: at most 3") if offered == MAXIMUM else ("", "")
        for name, aim in zip(("peer", "floor"), aims, strict=True):
            ratio = f"{costs['fleet'] / costs[name]:.2f} x"
            line(f"{offered} /s offered: CPU for a message against the {name}", ratio, aim)
