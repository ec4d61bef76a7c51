"""A program on the bus that says durable things, numbered and stamped: ``... BUS RATE PAD TWIN...``.

``PAD``: bytes that each is made longer by. At its end it prints how many it has said.
"""

import json
import sys
import time

from bench.bridge.floor import session

TICK = 0.01  # s


def main(bus, rate, pad, *twins):
    """Publish so many a second, in bursts of 10 ms, in turn for each twin."""
    opened = session(connect=bus)
    publishers = [opened.declare_publisher(f"cw/{twin}/data/navigate_status") for twin in twins]
    number, began, pad = 0, time.monotonic(), " " + "x" * int(pad) if int(pad) else ""
    try:
        while True:
            due = int((time.monotonic() - began) * float(rate))
            while number < due:
                note = {"ts": time.time(), "action_id": "a", "state": "running", "progress": 1.0}
                note["message"] = f"{number // len(twins)} {time.monotonic()}{pad}"
                publishers[number % len(twins)].put(json.dumps(note).encode())
                number += 1
            time.sleep(TICK)
    except KeyboardInterrupt:
        opened.close()
        print(number, flush=True)


main(*sys.argv[1:])
