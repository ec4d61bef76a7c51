"""Simulated edges of twenty robots for the fleet view.

``python -m bench.summary_puppets FIRST NUMBER ENDPOINT`` runs edges. ``router ENDPOINT`` runs the router that
they join. Ten edges form a site and share one session, as behind a site's router. Each edge shows what a real
one shows at this level: its token and its summaries, made and sent by the code of a real edge. A line ``EDGE
WORDS`` on standard input sets a fault of the edge's first robot with these words as its cause, and is
answered with the monotonic time. Without words it clears the fault.
"""

import asyncio
import gc
import resource
import sys
import time

from fleet.bus import keys
from fleet.bus.settings import BusSettings, zenoh_settings
from fleet.bus.zenoh_session import ZenohSession
from fleet.clock import SystemClock
from fleet.config.edge_section import EdgeConfig
from fleet.host.edge.summaries import Summaries
from fleet.host.runtime.tick_scheduler import TickScheduler
from fleet.model.health import Health
from fleet.model.state import RobotState

ROBOTS = 20
OF_A_SITE = 10  # edges that share a session


class PuppetRobot:
    """A robot as seen by its edge."""

    config = None

    def __init__(self, name, edge):
        self.fault = ""
        self.name, self._edge = name, edge

    def state(self):
        return RobotState(
            name=self.name,
            twin="6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11",
            adapter="ugv",
            edge=self._edge,
            stamp=time.time(),
            health="fault" if self.fault else "ok",
            cause=self.fault,
            battery=50.0,
        )


class PuppetEdge:
    """An edge whose robots are puppets."""

    def __init__(self, name, session, scheduler, loop):
        self._robots = [PuppetRobot(f"rover-{number}", name) for number in range(ROBOTS)]
        site = f"site-{int(name.rpartition('-')[2]) // OF_A_SITE}"
        summaries = Summaries(self, EdgeConfig(id=name, site=site), SystemClock())
        summaries.declare(session, scheduler, loop.call_soon_threadsafe)
        session.token(keys.edge(name))

    def robots(self):
        return self._robots

    def services(self):
        return [Health()]

    def has(self, fault):
        self._robots[0].fault = fault


def joined(name, router):
    """Open the session of a site, which stands for that of its router to the router above."""
    settings = BusSettings(name, connect=(router,))
    here = zenoh_settings(settings, mode="client", listen=(), connect=settings.connect)
    # Many sites join at once on one computer, and all of them take longer.
    return ZenohSession(here | {"transport/unicast/open_timeout": 10_000})


async def main(first, number, router):
    loop = asyncio.get_running_loop()
    scheduler = TickScheduler(loop, SystemClock())
    edges, sessions = {}, []
    for each in range(first, first + number):
        if not len(edges) % OF_A_SITE:
            # Kept, because a session without a reference is closed.
            sessions.append(joined(f"site-{each}", router))
        edges[f"edge-{each}"] = PuppetEdge(f"edge-{each}", sessions[-1], scheduler, loop)
        await asyncio.sleep(1 / number)  # spreads their polls over the second, as those of real edges are
    scheduler.start()
    gc.freeze()
    print("up", flush=True)
    while True:
        line = await loop.run_in_executor(None, sys.stdin.readline)
        if not line:
            return
        edge, _, word = line.strip().partition(" ")
        edges[edge].has(word)
        print(time.monotonic(), flush=True)


def route(endpoint):
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))  # each session takes two
    settings = BusSettings("router", mode="router", listen=(endpoint,))
    session = ZenohSession(zenoh_settings(settings, mode="router", listen=settings.listen, connect=()))
    print("up", flush=True)
    sys.stdin.read()
    session.close()


if __name__ == "__main__":
    if sys.argv[1] == "router":
        route(sys.argv[2])
    else:
        asyncio.run(main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]))
