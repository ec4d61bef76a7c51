"""``python -m bench [NAME ...]``."""

import importlib
import sys

NAMES = ("startup", "latency", "scale", "ugv", "quadruped")
WHEN_NAMED = ("dog_picture",)  # it writes into docs/


def main():
    for name in sys.argv[1:] or NAMES:
        if name not in NAMES + WHEN_NAMED:
            sys.exit(f"there is no benchmark {name!r}; there are {', '.join(NAMES + WHEN_NAMED)}")
        print(name, flush=True)
        importlib.import_module(f"bench.{name}").run()


main()
