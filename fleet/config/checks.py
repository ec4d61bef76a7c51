"""Checks across several robots or sections."""

from __future__ import annotations

import contextlib
import stat
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from uuid import UUID

from fleet.config.endpoints import (
    LONGEST_LISTENING_PATH,
    Proof,
    connecting_danger,
    folder_of,
    is_unencrypted,
    listening_danger,
    scouting_danger,
    shared_folder_danger,
    socket_too_long,
)
from fleet.config.identity import ValueIdentity
from fleet.config.problems import Mark
from fleet.config.schema import BusConfig, Sections
from fleet.config.text import nearest
from fleet.config.yaml import Document
from fleet.plugins.registry import Plugin
from fleet.robot_config import MAIN, AdapterConfig

MOST_NAMED = 5
"""Number of robots up to which a warning is repeated for each; beyond it, one warning covers all."""
_LINK = "way to the robot"
_APART = {
    "name": "give each robot a name of its own",
    "twin": "give each robot a twin of its own",
    _LINK: "give each robot a link of its own; several vehicles on one link have each its own system_id",
}


def check_robots(listed: object, identities: Mapping[int, ValueIdentity], document: Document) -> None:
    """Report robots that share a name, a twin or a physical machine, each at the later robot.

    ``identities`` are those of the robots whose config has one, by index in the list.
    """
    first: dict[tuple[str, object], int] = {}
    for index, robot in enumerate(listed if isinstance(listed, list) else ()):
        for what, value, key in _unique(robot, identities.get(index)):
            other = first.setdefault((what, value), index)
            if other != index:
                before = document.marks["robots", other]
                message = f"robots[{other}] ({before.file}:{before.line}) has the same {what}"
                document.report(_place(index, key, document), message, _APART[what])


def _unique(robot: object, identity: ValueIdentity | None) -> Iterator[tuple[str, object, str]]:
    """Yield the values that robots must not share: description, value, and key to report."""
    for key in ("name", "twin"):
        if isinstance(robot, dict) and isinstance(robot.get(key), str):
            yield key, _canonical_uuid(robot[key]) if key == "twin" else robot[key].lower(), key
    if identity is not None:
        yield _LINK, identity, "link"


def _canonical_uuid(text: str) -> str:
    """Return one spelling of a uuid, which may have no hyphens, or stand in braces."""
    with contextlib.suppress(ValueError):  # the model reports what is no uuid
        return str(UUID(text))
    return text.lower()


def _place(index: int, key: str, document: Document) -> Mark:
    """Return the mark of a robot's key, or of the robot if a default gave the value."""
    mark = document.marks.get(("robots", index, key))
    robot = document.marks["robots", index]
    return mark if mark and mark.path[:2] == robot.path else robot


def warn_of_adapters(plugins: Mapping[int, Plugin], document: Document) -> None:
    """Warn of each adapter that a later fleet refuses, at its first robot."""
    first: dict[str, int] = {}
    for index, plugin in plugins.items():
        if plugin.report and first.setdefault(plugin.name, index) == index:
            document.warn(_place(index, "adapter", document), plugin.report)


def warn_of_batteries(robots: Mapping[int, AdapterConfig], document: Document) -> None:
    """Warn of a battery policy that acts only when the reserve is used up."""
    for index, robot in robots.items():
        policy = robot.battery_policy
        if policy is None or policy.low >= policy.reserve:
            continue
        at = ("robots", index, "battery_policy")
        mark = document.keys.get((*at, "low")) or document.marks.get(at) or document.marks["robots", index]
        message = f"low ({policy.low:g} %) is below reserve ({policy.reserve:g} %)"
        document.warn(mark, message, "the action at low would end below the reserve; make low larger")


def check_followers(robots: Mapping[int, AdapterConfig], document: Document) -> None:
    """Report robots that follow a follower (which could form a loop), or a simulated robot."""
    by_twin = {robot.twin: robot for robot in robots.values()}
    for index, robot in robots.items():
        leader = by_twin.get(robot.follows) if robot.follows is not None else None
        if leader is None:
            continue
        mark = document.marks.get(("robots", index, "follows")) or document.marks["robots", index]
        if leader.follows is not None:
            document.report(mark, f"{leader.name} follows another robot itself", "follow that one")
        elif leader.simulated and not robot.simulated:
            hint = "a simulated robot moves no real one; follow a real one"
            document.report(mark, f"{leader.name} is simulated", hint)


def warn_of_places(
    robots: Mapping[int, AdapterConfig],
    at_home: Collection[int],
    *,
    has_site: bool,
    has_partners: bool,
    document: Document,
) -> None:
    """Warn of robots without a position in the site's frame, which are not kept apart from others.

    ``at_home`` are robots that report the geodetic position of their home. ``has_site``: the site has an
    origin. ``has_partners``: there are robots of other edges.
    """
    if len(robots) < 2 and not has_partners:
        return
    on_earth = [index for index, robot in robots.items() if robot.origin is not None or index in at_home]
    started = [index for index, robot in robots.items() if robot.start is not None]
    _warn_of_unplaced(sorted(robots.keys() - {*on_earth, *started}), document)
    others_on_earth = has_partners or set(on_earth) - set(started)
    for index in started if not has_site and others_on_earth else ():
        message = "the position of its start on Earth is unknown: no separation from robots placed on Earth"
        mark = document.marks.get(("robots", index, "start")) or document.marks["robots", index]
        document.warn(mark, message, "site: {origin: [latitude, longitude, altitude]}")


def _warn_of_unplaced(unplaced: Sequence[int], document: Document) -> None:
    """Warn of each robot that cannot be placed, or once for many: a file may have a thousand."""
    hint = "start: [metres east, metres north, heading in radians], from the site's origin"
    named = unplaced if len(unplaced) <= MOST_NAMED else unplaced[:1]
    others = len(unplaced) - len(named)
    whose = f"it and {others} other robots" if others else "it"
    for index in named:
        message = f"{whose} cannot be placed beside the others: separation unknown, they are not kept apart"
        document.warn(document.marks["robots", index], message, hint)


def warn_of_drop_ins(robots: Mapping[int, AdapterConfig], document: Document) -> None:
    """Warn of drop-in files that run in the edge's own process."""
    for index, robot in robots.items():
        if robot.worker == MAIN:
            mark = document.marks.get(("robots", index, "worker")) or document.marks["robots", index]
            message = f"the drop-in file of {robot.name} runs in the edge's own process"
            document.warn(
                mark,
                message,
                "it may read the cloud's secrets and end all robots' host; leave worker: main out",
            )


def check_names(data: Mapping[str, object], document: Document) -> None:
    """Report names that refer to nothing in another section."""
    for check in (
        _check_stop_inputs,
        _check_notify,
        _check_schedules,
        _check_workflows,
        _check_partners,
        _check_console_map,
    ):
        check(data, document)


def _check_stop_inputs(data: Mapping[str, object], document: Document) -> None:
    """Report stop inputs with equal names, and unknown robots and groups in them."""
    inputs, listed, groups = data.get("stop_inputs"), data.get("robots"), data.get("groups")
    if not isinstance(inputs, list) or not isinstance(listed, list):
        return
    names = {str(robot["name"]) for robot in listed if isinstance(robot, dict) and "name" in robot}
    names |= set(groups) if isinstance(groups, dict) else set()
    taken: set[str] = set()
    for index, one in enumerate(inputs):
        if not isinstance(one, dict):
            continue
        called = one.get("name")
        if isinstance(called, str) and called in taken:
            document.report(document.marks["stop_inputs", index, "name"], "another stop input has this name")
        taken.add(str(called))
        stopped = one.get("robots")
        for at, name in enumerate(stopped if isinstance(stopped, list) else ()):
            if isinstance(name, str) and name not in names:
                mark = document.marks["stop_inputs", index, "robots", at]
                document.report(mark, f"there is no robot or group {name!r}", nearest(name, names))


def _check_notify(data: Mapping[str, object], document: Document) -> None:
    """Report unknown robots and groups in targets of notices."""
    targets, listed, groups = (data.get(key) for key in ("notify", "robots", "groups"))
    if not isinstance(targets, list) or not isinstance(listed, list):
        return
    names = {str(robot["name"]) for robot in listed if isinstance(robot, dict) and "name" in robot}
    names |= set(groups) if isinstance(groups, dict) else set()
    for index, one in enumerate(targets):
        robots = one.get("robots") if isinstance(one, dict) else None
        for at, name in enumerate(robots if isinstance(robots, list) else ()):
            if isinstance(name, str) and name not in names:
                mark = document.marks["notify", index, "robots", at]
                document.report(mark, f"there is no robot or group {name!r}", nearest(name, names))


def _check_schedules(data: Mapping[str, object], document: Document) -> None:
    """Report unknown missions and robots in schedules."""
    schedules, missions, listed = (data.get(key) for key in ("schedules", "missions", "robots"))
    if not isinstance(schedules, dict) or not isinstance(listed, list):
        return
    known = set(missions) if isinstance(missions, dict) else set()
    robots = {str(robot["name"]) for robot in listed if isinstance(robot, dict) and "name" in robot}
    for name, one in schedules.items():
        if not isinstance(one, dict):
            continue
        mission = one.get("mission")
        if isinstance(mission, str) and mission not in known:
            mark = document.marks["schedules", name, "mission"]
            document.report(mark, f"there is no mission {mission!r}", nearest(mission, known))
        trigger = one.get("on_event")
        named = trigger.get("robots") if isinstance(trigger, dict) else None
        for at, robot in enumerate(named if isinstance(named, list) else ()):
            if isinstance(robot, str) and robot not in robots:
                mark = document.marks["schedules", name, "on_event", "robots", at]
                document.report(mark, f"there is no robot {robot!r}", nearest(robot, robots))


def _check_partners(data: Mapping[str, object], document: Document) -> None:
    """Report names of partner robots that are taken, and an edge that is its own partner."""
    partners, listed, edge = data.get("partners"), data.get("robots"), data.get("edge")
    robots = listed if isinstance(listed, list) else []
    taken = {str(robot.get("name")) for robot in robots if isinstance(robot, dict)}
    for name, partner in partners.items() if isinstance(partners, dict) else ():
        if isinstance(edge, dict) and edge.get("id") == name:
            document.report(document.keys["partners", name], "this is the edge of this file")
        there = partner.get("robots") if isinstance(partner, dict) else None
        for at, robot in enumerate(there if isinstance(there, list) else ()):
            if str(robot) in taken:
                mark = document.marks["partners", name, "robots", at]
                document.report(mark, f"there is another robot {robot!r}", "missions go by their names")
            taken.add(str(robot))


def _check_console_map(data: Mapping[str, object], document: Document) -> None:
    """Report a map for a site without an origin on Earth."""
    console, site = data.get("console"), data.get("site")
    if not isinstance(console, dict) or console.get("map") is None:
        return
    if not isinstance(site, dict) or site.get("origin") is None:
        hint = "site: {origin: [latitude, longitude, altitude]}"
        document.report(document.marks["console", "map"], "the site's position on this map is unknown", hint)


def _check_workflows(data: Mapping[str, object], document: Document) -> None:
    """Report unknown missions in workflows, and the second spelling of a uuid: it would replace the first."""
    cloud, missions = data.get("cloud"), data.get("missions")
    workflows = cloud.get("workflows") if isinstance(cloud, dict) else None
    known = set(missions) if isinstance(missions, dict) else set()
    uuids = set[str]()
    for uuid, one in workflows.items() if isinstance(workflows, dict) else ():
        if _canonical_uuid(str(uuid)) in uuids:
            document.report(document.marks["cloud", "workflows", uuid], "another workflow has this uuid")
        uuids.add(_canonical_uuid(str(uuid)))
        mission = one.get("mission") if isinstance(one, dict) else None
        if isinstance(mission, str) and mission not in known:
            mark = document.marks["cloud", "workflows", uuid, "mission"]
            document.report(mark, f"there is no mission {mission!r}", nearest(mission, known))


def check_bus(bus: BusConfig, document: Document) -> None:
    """Report each endpoint of the bus through which strangers could command the robots, at its position.

    Each endpoint is judged separately: the protection of one does not protect another.
    """
    tls = bus.tls
    proof = Proof(bus.password is not None, tls is not None, tls is not None and tls.mutual)
    for key, ends, danger in (
        ("listen", bus.listen, listening_danger),
        ("connect", bus.connect, connecting_danger),
    ):
        for index, end in enumerate(ends):
            mark = document.marks["bus", key, index]
            wrong = danger(end, proof, bus.insecure)
            if not wrong and _is_shared(folder_of(end)):
                wrong = shared_folder_danger(end, proof, bus.insecure)
            if not wrong and key == "listen":
                wrong = socket_too_long(end, LONGEST_LISTENING_PATH)
            if wrong:
                document.report(mark, wrong)
            elif is_unencrypted(end) and bus.insecure is not True:
                message = "the password is required, but the traffic can be read and changed on the network"
                document.warn(mark, message, "use a tls/ endpoint with tls:")
    if tls is not None and bus.listen and bus.access is None:
        message = (
            "every certificate of the authority permits everything, also that of another edge or a program"
        )
        document.warn(
            document.marks["bus", "tls"], message, "say who may do what in bus.access (docs/how-to/bus.md)"
        )
    if bus.scouting and (wrong := scouting_danger((*bus.listen, *bus.connect), proof, bus.insecure)):
        document.report(document.marks["bus", "scouting"], wrong)


def _is_shared(folder: str) -> bool:
    """Return True for a folder that every user of this computer can write to."""
    try:
        return bool(folder) and bool(Path(folder).stat().st_mode & stat.S_IWOTH)
    except OSError:
        return False


def check_consoles(sections: Sections, document: Document) -> None:
    """Report limits for unknown consoles."""
    consoles = [name for name, role in (sections.bus.access or {}).items() if role == "console"]
    for name in sections.bus.consoles:
        if name not in consoles:
            hint = nearest(name, consoles) or "access: gives it the role console"
            document.report(
                document.marks["bus", "consoles", name], f"{name!r} is no console in bus.access", hint
            )


def check_workers(sections: Sections, document: Document) -> None:
    """Report identities of workers that are not remote workers; local workers join by the sockets."""
    for name, role in (sections.bus.access or {}).items():
        if role == "worker" and name not in sections.remote_workers:
            hint = nearest(name, sections.remote_workers) or "a worker's identity is the worker's name"
            document.report(document.marks["bus", "access", name], f"{name!r} is not in remote_workers", hint)
