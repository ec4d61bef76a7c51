"""The bridge against the SDK's (the peer) and a bare relay (the floor), row by row."""

import importlib
import sys

ROWS = ("durable", "rtt", "inward", "command", "state", "outage")


def run(rows=()):
    for row in rows or ROWS:
        if row not in ROWS:
            sys.exit(f"there is no row {row!r}; there are {', '.join(ROWS)}")
        importlib.import_module(f"bench.bridge.{row}").run()
