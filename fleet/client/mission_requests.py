"""Requests about missions and runs to the edges."""

from __future__ import annotations

import msgspec

from fleet.bus import keys
from fleet.client.edges import Edges
from fleet.missions.report import (
    Controlled,
    MissionStartRequest,
    MissionState,
    RunControlRequest,
    RunState,
    Started,
)
from fleet.missions.results import RunFile
from fleet.missions.store import RunLogEntry


def missions(edges: Edges, name: str) -> list[MissionState]:
    """Return the missions of this name (``*``: all) on the edges."""
    return [found for _, _, found in edges.request_all(keys.mission("*", name), MissionState, by_person=True)]


def runs(edges: Edges, run: str) -> list[RunState]:
    """Return the runs of this id (``*``: all): those in progress and the newest ended ones."""
    return [found for _, _, found in edges.request_all(keys.run("*", run), RunState, by_person=True)]


def start(edges: Edges, edge: str, name: str, requested: MissionStartRequest) -> Started:
    """Start a mission on an edge; raises TimedOut without an answer."""
    return edges.request(keys.mission(edge, name), Started, requested, {"do": "start"})


def control(edges: Edges, edge: str, run: str, requested: RunControlRequest) -> Controlled:
    """Control a run; raises TimedOut without an answer of its edge."""
    return edges.request(keys.run(edge, run), Controlled, requested)


def story(edges: Edges, edge: str, run: str) -> list[RunLogEntry]:
    """Return the log of a run; raises TimedOut without an answer of its edge."""
    return edges.request(keys.run(edge, run), list[RunLogEntry], RunControlRequest("log"))


def results(edges: Edges, edge: str, run: str) -> list[RunFile]:
    """Return the results of a run, empty if there are none; the edge reads them from its disk."""
    requested = msgspec.json.encode(RunControlRequest("results"))
    found = edges.request_all(keys.run(edge, run), list[RunFile], requested, by_person=True)
    return [one for _, _, part in found for one in part]
