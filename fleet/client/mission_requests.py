"""The requests about missions and their runs that edges answer."""

from __future__ import annotations

import msgspec

from fleet.bus import keys
from fleet.client.edges import Edges
from fleet.missions.report import ControlAsk, Controlled, MissionState, RunState, StartAsk, Started
from fleet.missions.results import Result
from fleet.missions.store import Told


def missions(edges: Edges, name: str) -> list[MissionState]:
    """Return the missions of this name (``*``: all) that the edges know."""
    return [found for _, _, found in edges.asked(keys.mission("*", name), MissionState, by_person=True)]


def runs(edges: Edges, run: str) -> list[RunState]:
    """Return the runs of this id (``*``: all), those under way and the newest that ended."""
    return [found for _, _, found in edges.asked(keys.run("*", run), RunState, by_person=True)]


def start(edges: Edges, edge: str, name: str, asked: StartAsk) -> Started:
    """Start a mission on an edge; raises TimedOut when that does not answer."""
    return edges.one(keys.mission(edge, name), Started, asked, {"do": "start"})


def control(edges: Edges, edge: str, run: str, asked: ControlAsk) -> Controlled:
    """Control a run; raises TimedOut when its edge does not answer."""
    return edges.one(keys.run(edge, run), Controlled, asked)


def story(edges: Edges, edge: str, run: str) -> list[Told]:
    """Return what happened in a run; raises TimedOut when its edge does not answer."""
    return edges.one(keys.run(edge, run), list[Told], ControlAsk("log"))


def results(edges: Edges, edge: str, run: str) -> list[Result]:
    """Return what a run left behind, nothing where its edge has nothing of it; waits for its disk."""
    asked = msgspec.json.encode(ControlAsk("results"))
    found = edges.asked(keys.run(edge, run), list[Result], asked, by_person=True)
    return [one for _, _, part in found for one in part]
