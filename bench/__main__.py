"""Command line of the benchmarks, some of which have rows: ``python -m bench [NAME[:ROW,...] ...]``."""

import importlib
import signal
import sys

NAMES = (
    "startup",
    "latency",
    "scale",
    "deadman",
    "bridge",
    "ugv",
    "quadruped",
    "mavlink",
    "watchers",
    "stops",
    "together",
    "pad",
    "console",
    "record",
    "fleet_view",
    "soak",
    "dog_picture",
)
AT_ONCE = NAMES[:-2]  # the soak runs for as long as it is given, and the picture is written into docs/


def main():
    # Shells start background jobs with SIGINT ignored, and child processes inherit that, although the
    # benchmarks end them with SIGINT.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for requested in sys.argv[1:] or AT_ONCE:
        name, _, rows = requested.partition(":")
        if name not in NAMES:
            sys.exit(f"there is no benchmark {name!r}; there are {', '.join(NAMES)}")
        print(name, flush=True)
        benchmark = importlib.import_module(f"bench.{name}")
        if rows:
            benchmark.run(rows.split(","))
        else:
            benchmark.run()


main()
