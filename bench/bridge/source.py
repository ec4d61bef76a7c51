"""A program on the bus that says durable things, numbered and stamped: ``... BUS RATE TWIN...``."""

import json
import sys
import time

from bench.bridge.floor import session

TICK = 0.01  # s


def main(bus, rate, *twins):
    """Publish so many a second, in bursts of 10 ms, in turn for each twin."""
    opened = session(connect=bus)
    publishers = [opened.declare_publisher(f"cw/{twin}/data/navigate_status") for twin in twins]
    number, began = 0, time.monotonic()
    while True:
        due = int((time.monotonic() - began) * float(rate))
        while number < due:
            note = {"ts": time.time(), "action_id": "a", "state": "running", "progress": 1.0}
            note["message"] = f"{number // len(twins)} {time.monotonic()}"
            publishers[number % len(twins)].put(json.dumps(note).encode())
            number += 1
        time.sleep(TICK)


main(*sys.argv[1:])
