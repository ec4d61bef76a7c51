"""``python -m bench [NAME ...]``."""

import importlib
import sys

NAMES = ("startup", "latency", "scale", "ugv", "quadruped", "mavlink")


def main():
    for name in sys.argv[1:] or NAMES:
        if name not in NAMES:
            sys.exit(f"there is no benchmark {name!r}; there are {', '.join(NAMES)}")
        print(name, flush=True)
        importlib.import_module(f"bench.{name}").run()


main()
