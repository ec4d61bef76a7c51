"""Our bridge compared with the SDK's bridge (the peer) and a bare relay (the floor), row by row.

``python -m bench bridge:ROW,ROW=SIZE``. Rows with a size have a long form, selected by it.
"""

import importlib
import sys

ROWS = ("durable", "rtt", "inward", "command", "stop", "state", "outage", "faults", "memory")
SIZED = {
    "stop": "stops",
    "outage": "seconds without the broker",
    "faults": "kills of the broker; 60 commands for each",
    "memory": "thousands of messages in the outage",
}


def run(rows=()):
    for requested in rows or ROWS:
        row, _, size = requested.partition("=")
        if row not in ROWS:
            sys.exit(f"there is no row {row!r}; there are {', '.join(ROWS)}")
        if size and row not in SIZED:
            sized = ", ".join(f"{name} ({what})" for name, what in SIZED.items())
            sys.exit(f"row {row} has no size; these have: {sized}")
        module = importlib.import_module(f"bench.bridge.{row}")
        module.run(*([float(size)] if size else []))
