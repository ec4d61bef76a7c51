"""Publisher of numbered, timestamped durable messages on the bus: ``... BUS RATE PAD TWIN...``.

Each message is padded by ``PAD`` bytes. At its end the program prints how many it has published.
"""

import json
import sys
import time

from bench.bridge.floor import session

TICK = 0.01  # s


def main(bus, rate, pad, *twins):
    """Publish ``rate`` messages a second in bursts of 10 ms, for each twin in turn."""
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
