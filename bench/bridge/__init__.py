"""The bridge against the SDK's (the peer) and a bare relay (the floor)."""

import importlib

ROWS = ("state",)


def run(rows=()):
    for row in rows or ROWS:
        importlib.import_module(f"bench.bridge.{row}").run({})
