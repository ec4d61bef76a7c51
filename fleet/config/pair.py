"""A pair of edges in one fleet.yaml: the choice of this computer's edge, and the limits of a pair."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping

import msgspec

from fleet.config.edge_id import EDGE_ID
from fleet.config.yaml import Document
from fleet.plugins.registry import Plugin
from fleet.robot_config import MAIN, AdapterConfig

LOCAL = ("serial", "can", "memory", "sim")
"""Schemes of links that only one computer can open."""


def choose_edge(document: Document, environ: Mapping[str, str]) -> None:
    """Set ``edge.id`` in the file of a pair: from the environment, else the first of the two."""
    data = document.data
    pair, edge = data.get("pair"), data.get("edge", {})
    if not isinstance(pair, list) or not pair or not isinstance(edge, dict | None):
        return
    mark = document.marks["pair",]
    if edge and "id" in edge:
        message = "the file of a pair is for both edges; leave edge.id out"
        document.report(document.marks["edge", "id"], message, f"fleet run --edge-id {pair[0]}")
        return
    chosen = environ.get(EDGE_ID) or pair[0]
    if chosen not in pair:
        document.report(mark, f"this computer is to be {chosen!r}, which is not in pair")
        return
    data["edge"] = {**(edge or {}), "id": chosen}
    for path in (("edge",), ("edge", "id")):
        document.marks.setdefault(path, msgspec.structs.replace(mark, path=path))


def check_pair(robots: Mapping[int, tuple[AdapterConfig, Plugin]], document: Document) -> None:
    """Report settings that a pair does not support, and warn of robots without a standby."""
    data = document.data
    if "lease" in data and "pair" not in data:
        document.report(document.marks["lease",], "a lease is for a pair of edges", "pair: [a, b]")
    if "pair" not in data:
        return
    if "lease" not in data:
        hint = "lease: {servers: [tls://HOST:4222]}; without it no edge takes over from another"
        document.report(document.marks["pair",], "a pair needs the lease service", hint)
    if isinstance(data["pair"], list) and len(set(map(str, data["pair"]))) < len(data["pair"]):
        document.report(document.marks["pair",], "a pair is two edges", "pair: [a, b]")
    if importlib.util.find_spec("nats") is None:
        message = "a pair needs the client of the lease service"
        document.report(document.marks["pair",], message, "pip install 'zenoh-fleet[standby]'")
    if data.get("remote_workers"):
        message = "workers on other computers cannot be kept from the robots by the lease of a pair"
        document.report(document.marks["remote_workers",], message, "leave remote_workers out")
    for index, (robot, plugin) in robots.items():
        mark = document.marks["robots", index]
        if robot.worker not in {None, MAIN} or (plugin.file is not None and robot.worker != MAIN):
            message = f"{robot.name} runs in a worker, which the lease of a pair does not reach"
            document.report(mark, message, "worker: main, or put it into an edge of its own")
        for link in filter(is_local_link, links_of(robot)):
            message = f"{robot.name} has no standby: only one computer can open {link}"
            document.warn(mark, message, "it cannot be reached while the other edge has the lease")


def links_of(robot: AdapterConfig) -> list[str]:
    """Return the links of a robot."""
    several = getattr(robot, "links", None)
    found = several if isinstance(several, list | tuple) else (getattr(robot, "link", None),)
    return [link for link in found if isinstance(link, str)]


def is_local_link(link: str) -> bool:
    """Return True if only one computer can open a link: its device, or a simulator that it starts."""
    return link.partition(":")[0] in LOCAL
