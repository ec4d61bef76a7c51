"""Differences between two loaded fleet files, robot by robot; pure.

A file is compared by its ``ComparedFile``: every relevant field as text. The tables ``SECTIONS`` and
``FIELDS`` define which changes a running edge cannot apply before its next start, and why.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from collections.abc import Callable, Iterable, Mapping
from collections.abc import Set as AbstractSet
from pathlib import Path, PurePath
from typing import Any

import msgspec
from pydantic import BaseModel, SecretStr

from fleet.adapter import Adapter
from fleet.config.load import Loaded
from fleet.config.masking import MASK, Masking
from fleet.config.problems import is_secret
from fleet.model.change import Change, ChangeKind
from fleet.plugins.registry import Plugin
from fleet.robot_config import AdapterConfig

NAVIGATES = "adapter navigates"
PLAIN = frozenset({NAVIGATES, "twin"})
"""Fields whose values are not replaced by digests, because other decisions depend on them."""
LONGEST = 60  # characters of a shown value

SECTIONS: Mapping[str, str] = {
    "edge": "its id is in every key of the bus and in the path of its state; spool and history are open",
    "pair": "the lease that the two edges share is named by it",
    "lease": "the connection to the lease service is opened with it",
    "cloud": "the connection is opened with it, and what waits to be sent belongs to it",
    "bus": "the sessions and their access rules are fixed when they are opened",
    "site": "the robots are placed in its frame",
    "metrics": "its port is opened at the start",
    "console": "its process is started with the edge",
    "record": "its process is started with the edge",
    "plugins": "adapters are looked for at the start; fleet adapters reload takes a changed file into use",
    "remote_workers": "they are started by hand, with a copy of the file",
    "partners": "the runs of other edges refer to them",
    "stop_inputs": "their devices are opened at the start, and hold the robots",
}
"""Sections that only the next start applies, with the reason. ``defaults`` is compared through the robots."""

LIVE_SECTIONS: Mapping[str, str] = {
    "missions": "the next run has them; runs under way keep their copy",
    "events": "missions may wait for them from then on",
    "places": "while no run is under way; a goal that was given before stays where it is",
    "groups": "at once, also for stops; not while a stop input names one that changes",
    "notify": "from the next event on; a target that is gone still sends what waits",
    "schedules": "a changed schedule counts from then on; firings of one that is gone are skipped",
}
"""Sections that the running edge applies, with the effect."""

LED = frozenset({"fence", "limits"})
"""Settings that are also used by adapters that navigate: for these the adapter is rebuilt at rest."""

SETTINGS = frozenset({"accepts", "battery_policy", "fence", "limits", "separation"})
"""Robot settings that the host applies without a new adapter: stricter at once, looser at rest."""

FIELDS: Mapping[str, str] = {
    "name": "its stop, its leases and all that is asked of it go by the name",
    "twin": "other edges know it by the claim on its twin",
    "worker": "it moves to another process",
    "adapter": "another kind of robot has other commands",
    "clock_skew": "the clocks of senders are measured with it",
    "follows": "its leader is subscribed to at the start",
    "origin": "the robot is placed in the site's frame by it",
    "start": "it says where the robot stands when the edge starts",
    "role": "its reports carry it to the cloud",
    "simulated": "its reports carry it to the cloud",
    "legacy_status": "the bridge to the cloud has it",
    "rotation_order": "requests that wait are read by it",
    "rules": "the bridge to the cloud has it",
    "inbound": "the bridge to the cloud has it",
}
"""Robot fields that only the next start applies, with the reason; any other change rebuilds the robot."""


class ComparedFile(msgspec.Struct, frozen=True):
    """A fleet file in the form for comparison: sections, and robots' fields by dotted name, as JSON."""

    edge: str
    sections: Mapping[str, Mapping[str, str]]
    robots: Mapping[str, Mapping[str, str]]

    def digest(self, key: bytes) -> ComparedFile:
        """Return a copy with every value replaced by its keyed digest, except those of ``PLAIN``."""

        def hidden(fields: Mapping[str, str]) -> dict[str, str]:
            return {name: value if name in PLAIN else _digest(key, value) for name, value in fields.items()}

        return ComparedFile(
            self.edge,
            {name: hidden(fields) for name, fields in self.sections.items()},
            {name: hidden(fields) for name, fields in self.robots.items()},
        )


def outline_of(loaded: Loaded) -> ComparedFile:
    """Return the outline of a loaded fleet file."""
    config = loaded.config
    sections = {name: flat(getattr(config, name)) for name in (*SECTIONS, *LIVE_SECTIONS)}
    sections["missions"] = {mission.name: _text(mission.data) for mission in loaded.missions}
    robots = {robot.name: _robot(robot, plugin, loaded.given[robot.name]) for robot, plugin in loaded.robots}
    return ComparedFile(config.edge.id, sections, robots)


def _robot(config: AdapterConfig, plugin: Plugin, given: str) -> dict[str, str]:
    """Return the fields of a robot: the host's, the adapter's own, and the origin of its code."""
    fields = {**json.loads(given), **dict(config), "adapter": plugin.name, "simulated": config.simulated}
    fields[NAVIGATES] = _navigates(plugin)
    if plugin.file is not None:
        fields["adapter file"] = plugin.file
    fields.pop("is_simulated", None)
    return flat(fields)


def _navigates(plugin: Plugin) -> bool:
    """Return True if the adapter itself leads its robot to goals."""
    if plugin.description is not None:
        return plugin.description.navigates
    kind = plugin.adapter
    return kind is not None and issubclass(kind, Adapter) and kind.navigates()


def flat(value: Any) -> dict[str, str]:
    """Return a value as fields by dotted name; empty and missing values have none, so they compare equal."""
    found: dict[str, str] = {}
    _flatten("", value, found)
    return found


def _flatten(at: str, value: Any, found: dict[str, str]) -> None:
    """Add a value to the found fields."""
    if isinstance(value, BaseModel):
        value = dict(value)
    if isinstance(value, Mapping):
        for key, part in value.items():
            _flatten(f"{at}.{key}" if at else str(key), part, found)
    elif value is not None:
        found[at] = _text(value)


def _text(value: Any) -> str:
    """Return a value as canonical JSON, including secrets."""
    return json.dumps(value, default=_plain, sort_keys=True, ensure_ascii=False)


def _plain(value: Any) -> Any:
    """Convert values that JSON does not support."""
    if isinstance(value, SecretStr):
        return value.get_secret_value()
    if isinstance(value, BaseModel):
        return dict(value)
    if isinstance(value, frozenset | set):
        return sorted(value, key=str)
    if isinstance(value, Path):  # relative to where the command was started, which is no difference
        return str(value.absolute())
    return repr(value) if hasattr(value, "__dict__") else str(value)


def _digest(key: bytes, value: str) -> str:
    return hmac.new(key, value.encode(), hashlib.sha256).hexdigest()


def difference(old: ComparedFile, new: ComparedFile, shown: Callable[[str, str], str]) -> tuple[Change, ...]:
    """Return the changes: each robot of either file once, then each section that differs.

    ``shown`` formats the value (JSON) of a field for users, without secrets.
    """
    before = _new_names(old, new)
    gone = old.robots.keys() - new.robots.keys() - set(before.values())
    names = [*new.robots, *(name for name in old.robots if name in gone)]
    robots = [
        _renamed(name, old.robots[before[name]], new.robots[name], shown)
        if name in before
        else _robot_change(name, old.robots.get(name), new.robots.get(name), shown)
        for name in names
    ]
    known = dict.fromkeys((*old.sections, *new.sections))
    sections = [
        _section_change(name, fields)
        for name in known
        if (fields := _fields(old.sections.get(name, {}), new.sections.get(name, {}), shown))
    ]
    return (*robots, *sections)


def _new_names(old: ComparedFile, new: ComparedFile) -> dict[str, str]:
    """Return renamed robots, new name to old; a name in both files is no rename."""
    return {
        name: was
        for name, was in renamed(old, new).items()
        if name not in old.robots and was not in new.robots and "twin" in new.robots[name]
    }


def _section_change(name: str, fields: tuple[str, ...]) -> Change:
    """Return the change of a section that differs."""
    if name in LIVE_SECTIONS:
        return Change(name, ChangeKind.SETTINGS, fields, section=True)
    return Change(name, ChangeKind.RESTART, fields, SECTIONS.get(name, "a newer fleet has it"), section=True)


def _robot_change(
    name: str,
    old: Mapping[str, str] | None,
    new: Mapping[str, str] | None,
    shown: Callable[[str, str], str],
) -> Change:
    """Return the change of one robot."""
    if new is None:
        return Change(name, ChangeKind.REMOVED)
    if old is None:
        return Change(name, ChangeKind.ADDED)
    fields = _fields(old, new, shown)
    kind, why = _judged({field.split(".")[0] for field in changed(old, new)}, old.get(NAVIGATES) == "true")
    return Change(name, kind, fields, why)


def _renamed(
    name: str, old: Mapping[str, str], new: Mapping[str, str], shown: Callable[[str, str], str]
) -> Change:
    """Return the change of a renamed robot, whatever else differs."""
    return Change(name, ChangeKind.RESTART, _fields(old, new, shown), f"name: {FIELDS['name']}")


def _judged(fields: AbstractSet[str], navigates: bool) -> tuple[ChangeKind, str]:  # noqa: FBT001 - by position
    """Return the kind of a change of some fields of a robot, with the reason for a restart."""
    why = "; ".join(f"{field}: {FIELDS[field]}" for field in sorted(fields & FIELDS.keys()))
    if why:
        return ChangeKind.RESTART, why
    if fields - SETTINGS or (navigates and fields & LED):
        return ChangeKind.REBUILT, ""
    return (ChangeKind.SETTINGS if fields else ChangeKind.UNTOUCHED), ""


def changed(old: Mapping[str, str], new: Mapping[str, str]) -> list[str]:
    """Return the names of the fields that differ, sorted."""
    return sorted(name for name in {*old, *new} if old.get(name) != new.get(name))


def _fields(
    old: Mapping[str, str], new: Mapping[str, str], shown: Callable[[str, str], str]
) -> tuple[str, ...]:
    """Return the fields that differ, as text for users."""
    return tuple(_line(name, old.get(name), new.get(name), shown) for name in changed(old, new))


def _line(name: str, old: str | None, new: str | None, shown: Callable[[str, str], str]) -> str:
    """Return one field that differs, with its old and new value."""
    texts = [value and shown(name, value) for value in (old, new)]
    if not any(texts):
        return name
    return f"{name}: {texts[0] or 'none'} -> {texts[1] or 'none'}"


OF_ONE_COMPUTER = frozenset(
    {"edge", "lease", "cloud", "bus", "metrics", "console", "record", "plugins", "notify", "remote_workers"}
)
"""Sections that may differ between the computers of a pair, by variables and secrets."""
LINKS = frozenset({"link", "links"})


def digest_of(loaded: Loaded) -> str:
    """Return ``pair_digest`` of a loaded fleet file."""
    return pair_digest(outline_of(loaded), loaded.folder.absolute())


def pair_digest(outline: ComparedFile, folder: PurePath) -> str:
    """Return the digest of the parts that both edges of a pair must share: robots, missions, places etc.

    Links and the ``folder`` of the file may differ. The digest leaves the computer, so it contains no
    secrets.
    """
    sections = {name: fields for name, fields in outline.sections.items() if name not in OF_ONE_COMPUTER}
    shared = [
        (name, field, value.replace(str(folder), "."))
        for parts in (sections, outline.robots)
        for name, fields in sorted(parts.items())
        for field, value in sorted(fields.items())
        if field.partition(".")[0] not in LINKS and not _is_secret(field)
    ]
    return hashlib.sha256(json.dumps(shared).encode()).hexdigest()[:16]


def _is_secret(field: str) -> bool:
    """Return True if a field's value is a secret, by its dotted name."""
    return any(map(is_secret, field.split(".")))


def shown_by(secrets: Iterable[str]) -> Callable[[str, str], str]:
    """Return a function that formats values for users, without these secrets and those of secret fields."""
    masking = Masking(secrets)

    def shown(name: str, value: str) -> str:
        if _is_secret(name):
            return MASK
        text = masking.text(value)
        text = text[1:-1] if text.startswith('"') else text
        return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."

    return shown


def not_shown(_name: str, _value: str) -> str:
    """Return an empty text: only digests are known."""
    return ""


def renamed(old: ComparedFile, new: ComparedFile) -> dict[str, str]:
    """Return robots whose twin had another name in the old file, new name to old."""
    before = {fields.get("twin"): name for name, fields in old.robots.items()}
    names = {name: before.get(fields.get("twin"), name) for name, fields in new.robots.items()}
    return {name: was for name, was in names.items() if was != name}
