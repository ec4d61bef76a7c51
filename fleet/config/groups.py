"""fleet.yaml's ``groups``: names for several robots, with common settings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from fleet.config.problems import YamlPath
from fleet.config.text import nearest
from fleet.config.yaml import Document
from fleet.robot_config import Accepts, Limits, Name
from fleet.yaml_model import Model

SHARED = ("accepts", "limits")
"""Settings that a group may give its robots."""


class GroupConfig(Model):
    """Several robots with common settings; a robot's own settings take precedence."""

    robots: tuple[Name, ...] = Field(description="Its robots.")
    accepts: Accepts | None = Field(None, description="Whose commands each of them obeys.")
    limits: Limits | None = Field(
        None, description="Of each of them; they take precedence over the adapter's own."
    )


def _form(given: Any) -> str:
    """Return which of its two forms a group has."""
    return "group" if isinstance(given, dict | GroupConfig) else "robots"


Group = Annotated[
    Annotated[tuple[Name, ...], Tag("robots")] | Annotated[GroupConfig, Tag("group")], Discriminator(_form)
]


def members_of(group: tuple[str, ...] | GroupConfig) -> tuple[str, ...]:
    """Return the robots of a group in either form."""
    return group.robots if isinstance(group, GroupConfig) else group


def said_by_groups(name: str, document: Document) -> Iterator[tuple[YamlPath, dict[str, Any]]]:
    """Yield the settings from the groups of a robot, with their paths, in the order of the file."""
    groups = document.data.get("groups")
    for group, given in groups.items() if isinstance(groups, dict) else ():
        listed = given.get("robots") if isinstance(given, dict) else None
        if isinstance(listed, list) and name in listed:
            yield ("groups", group), {key: given[key] for key in SHARED if key in given}


def contradiction(one: Any, other: Any) -> bool:
    """Return True if two groups give different values for the same field."""
    if isinstance(one, dict) and isinstance(other, dict):
        return any(contradiction(one[key], other[key]) for key in one.keys() & other.keys())
    if isinstance(one, list) and isinstance(other, list):
        return sorted(map(str, one)) != sorted(map(str, other))
    return bool(one != other)


def check_groups(data: Mapping[str, Any], document: Document) -> None:
    """Report groups with unknown or repeated robots, and groups with the name of a robot."""
    groups = data.get("groups")
    listed = data.get("robots")
    if not isinstance(groups, dict) or not isinstance(listed, list):
        return
    names = {str(robot["name"]) for robot in listed if isinstance(robot, dict) and "name" in robot}
    for group, given in groups.items():
        if group in names:
            document.report(document.keys["groups", group], "a robot has this name too", "rename the group")
        at: YamlPath = ("groups", group, "robots") if isinstance(given, dict) else ("groups", group)
        members = given.get("robots") if isinstance(given, dict) else given
        for index, member in enumerate(members if isinstance(members, list) else ()):
            place = document.marks[*at, index]
            if isinstance(member, str) and member not in names:
                document.report(place, f"there is no robot {member!r}", nearest(member, names))
            elif member in (members or ())[:index]:
                document.report(place, f"{member!r} is in the group already")
