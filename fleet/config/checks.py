"""What can only be seen by looking at several robots at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fleet.config.problems import Mark
from fleet.config.text import nearest
from fleet.config.yaml import Document
from fleet.robot_config import MAIN, AdapterConfig

Identity = tuple[object, str]
"""A kind of robot, and the very machine."""
_WAY = "way to the robot"
_APART = {
    "name": "give each robot a name of its own",
    "twin": "give each robot a twin of its own",
    _WAY: "give each robot a link of its own; several vehicles on one link have each its own system_id",
}


def check_robots(listed: Any, identities: Mapping[int, Identity], document: Document) -> None:
    """Report, at the later one, robots that share a name, a twin, or the very same machine.

    ``identities`` are those of the robots, by place in the list, whose config has one.
    """
    first: dict[tuple[str, object], int] = {}
    for index, robot in enumerate(listed if isinstance(listed, list) else ()):
        for what, value, key in _unique(robot, identities.get(index)):
            other = first.setdefault((what, value), index)
            if other != index:
                before = document.marks["robots", other]
                message = f"robots[{other}] ({before.file}:{before.line}) has the same {what}"
                document.report(_place(index, key, document), message, _APART[what])


def identity_of(config: AdapterConfig) -> Identity | None:
    """Return what machine a config stands for, as far as it tells.

    A config may define ``identity() -> str | None``: equal for two configs of one class that reach the
    very same machine (the same link and system id, say), None when that cannot happen.
    """
    identity = getattr(config, "identity", None)
    value = identity() if callable(identity) else None
    return None if value is None else (type(config), value)


def _unique(robot: Any, identity: Identity | None) -> Iterator[tuple[str, object, str]]:
    """Yield what no two robots may share: the word for it, the value, the key to point at."""
    for key in ("name", "twin"):
        if isinstance(robot, dict) and isinstance(robot.get(key), str):
            yield key, robot[key].lower(), key
    if identity is not None:
        yield _WAY, identity, "link"


def _place(index: int, key: str, document: Document) -> Mark:
    """Return the mark of a robot's key, or of the robot when defaults gave the value."""
    mark = document.marks.get(("robots", index, key))
    robot = document.marks["robots", index]
    return mark if mark and mark.path[:2] == robot.path else robot


def warn_of_batteries(robots: Mapping[int, AdapterConfig], document: Document) -> None:
    """Warn of a battery policy that calls a robot home only when its reserve is used up."""
    for index, robot in robots.items():
        policy = robot.battery_policy
        if policy is None or policy.low >= policy.reserve:
            continue
        at = ("robots", index, "battery_policy")
        mark = document.keys.get((*at, "low")) or document.marks.get(at) or document.marks["robots", index]
        message = f"low ({policy.low:g} %) is below reserve ({policy.reserve:g} %)"
        document.warn(mark, message, "what is done at low would end below the reserve; make low the larger")


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


def check_stop_inputs(data: Mapping[str, Any], document: Document) -> None:
    """Report stop inputs of one name, and those that stop what there is not."""
    inputs, listed, groups = data.get("stop_inputs"), data.get("robots"), data.get("groups")
    if not isinstance(inputs, list) or not isinstance(listed, list):
        return
    names = {str(robot["name"]) for robot in listed if isinstance(robot, dict) and "name" in robot}
    names |= set(groups) if isinstance(groups, dict) else set()
    taken: set[str] = set()
    for index, one in enumerate(inputs):
        if not isinstance(one, dict):
            continue
        if one.get("name") in taken:
            document.report(document.marks["stop_inputs", index, "name"], "another stop input has this name")
        taken.add(str(one.get("name")))
        stopped = one.get("robots")
        for at, name in enumerate(stopped if isinstance(stopped, list) else ()):
            if isinstance(name, str) and name not in names:
                mark = document.marks["stop_inputs", index, "robots", at]
                document.report(mark, f"there is no robot or group {name!r}", nearest(name, names))


def check_groups(data: Mapping[str, Any], document: Document) -> None:
    """Report groups that name no robot, name one twice, or are called like one."""
    groups = data.get("groups")
    listed = data.get("robots")
    if not isinstance(groups, dict) or not isinstance(listed, list):
        return
    names = {str(robot["name"]) for robot in listed if isinstance(robot, dict) and "name" in robot}
    for group, members in groups.items():
        if group in names:
            document.report(document.keys["groups", group], "a robot has this name too", "rename the group")
        for index, member in enumerate(members if isinstance(members, list) else ()):
            place = document.marks["groups", group, index]
            if isinstance(member, str) and member not in names:
                document.report(place, f"there is no robot {member!r}", nearest(member, names))
            elif member in members[:index]:
                document.report(place, f"{member!r} is in the group already")
