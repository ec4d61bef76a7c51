"""Access rules of the bus, per identity, in the form of Zenoh's access control.

An identity is the common name of a certificate. Anything not allowed here is refused. The rules are fixed
for the lifetime of a session, so they use key patterns and name no robot: adding a robot needs no new rules.
Programs on this computer connect through Unix sockets, which only their user can open, and may do everything.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

import msgspec

from fleet.bus import keys
from fleet.config.endpoints import PERSONS, Role
from fleet.model.permission import Permission

PROGRAM_CHANNELS = (
    "commands",
    "depth",
    "driverlog",
    "event",
    "frames",
    "local/webrtc_offer",
    "map_update",
    "metrics",
    "model_health",
    "model_output",
    "photo",
    "pointcloud",
    "streams",
    "webrtc_answer",
    "webrtc_candidate",
    "webrtc_offer",
)
"""Channels that a program may write: sensor data, results and velocities, but not a robot's own state."""

_REPORTS = "cw/*/data/**"
_STOP = "fleet/*/stop"
_DESCRIPTION = "fleet/*/robots/*/description"
_CONSOLE_KEYS = (
    keys.command("*", "*"),
    keys.mission("*", "*"),
    keys.run("*", "*"),
    keys.schedules("*"),
)
_COMMAND_LINE_KEYS = (keys.prepare("*", "*"), keys.starts("*"))
_BY_CERTIFICATE = frozenset({"tls", "quic"})

_LISTEN = ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber")
_PUBLISH = ("put", "delete")
_ANSWER = ("declare_queryable", "reply")
_ALL = (*_PUBLISH, "query", *_ANSWER, "liveliness_token", *_LISTEN)


class Access(msgspec.Struct, frozen=True):
    """Access settings of an edge's bus: the role of each common name.

    ``twins`` are the edge's own, about which other edges may not publish; ``channels`` are those that
    programs may write in addition to ``PROGRAM_CHANNELS``; ``coordinators`` the other edges that may command
    the edge's robots in runs of missions; ``consoles`` the most that persons at a console may do, where that
    is not everything.
    """

    roles: Mapping[str, Role]
    twins: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    coordinators: frozenset[str] = frozenset()
    consoles: Mapping[str, Permission] = {}


class _Rule(msgspec.Struct, frozen=True):
    """One rule: kinds of messages that are allowed or denied on some keys."""

    messages: tuple[str, ...]
    keys: tuple[str, ...]
    permission: Literal["allow", "deny"] = "allow"
    flow: Literal["ingress", "egress"] = "ingress"

    def as_zenoh(self, name: str) -> dict[str, object]:
        """Return the rule in the form of Zenoh's configuration."""
        return {
            "id": name,
            "messages": list(self.messages),
            "flows": [self.flow],
            "permission": self.permission,
            "key_exprs": list(self.keys),
        }


_COMMON = (
    _Rule(_ALL, ("**",), flow="egress"),
    _Rule(_LISTEN, ("**",)),
    _Rule(("query",), ("fleet/*/robots/*/state", _DESCRIPTION, "fleet/*/health", _REPORTS)),
    _Rule(("query",), (keys.summary("*"),)),
)
"""Rules of every role: subscribe to everything, and query states."""

_STOPS = (
    _Rule(("put", "query"), (_STOP,)),
    _Rule(("reply", "declare_subscriber", "declare_queryable"), (_STOP,), flow="egress"),
)
"""Rules of every valid certificate, with or without a role: it may stop (ADR 0010)."""


_NO_FRAMES = _Rule(("put",), ("fleet/*/frames/*",), "deny", flow="egress")
"""The bytes on the links are for recorders only: a console, or a program on the edge's own computer."""


_START_TOKEN = _Rule(("liveliness_token",), (keys.starting("*", "*"),))
"""Shows that the requester of a common start is up."""


def rules_of(role: Role, name: str, edge: str, access: Access) -> tuple[_Rule, ...]:
    """Return the rules of one identity on the bus of an edge, in addition to the common ones."""
    if role == "router":
        return (_Rule(_ALL, ("**",)),)
    if role == "console":
        return _console_rules(name, access.consoles.get(name, Permission.ADMIN))
    if role in PERSONS:
        return _person_rules(name, PERSONS[role])
    if role == "program":
        channels = (*PROGRAM_CHANNELS, *access.channels)
        return (
            _NO_FRAMES,
            _Rule((*_PUBLISH, *_ANSWER), tuple(f"cw/*/data/{channel}/**" for channel in channels)),
            _Rule(_ANSWER, ("fleet/*/robots/*/video",)),
        )
    if role == "worker":
        return _worker_rules(name, edge)
    foreign = tuple(f"cw/{twin}/data/**" for twin in access.twins)
    own = (f"fleet/{name}", f"fleet/{name}/**")
    coordinated = (f"fleet/{edge}/coordinator", f"fleet/{edge}/robots/*/command")
    return (
        _NO_FRAMES,
        *((_Rule(("query",), coordinated),) if name in access.coordinators else ()),
        _Rule((*_PUBLISH, *_ANSWER, "liveliness_token"), own),
        _Rule((*_PUBLISH, *_ANSWER), (_REPORTS,)),
        _Rule((*_PUBLISH, *_ANSWER), ("cw/*/data/commands/**", *foreign), "deny"),
    )


def _console_rules(name: str, most: Permission) -> tuple[_Rule, ...]:
    """Return the rules of a console: keys with its own name, and no permission above ``most``.

    A console that may give every permission also runs the command line, whose keys name no permission.
    """
    given = [each.word for each in Permission if each <= most]
    requested = [keys.as_console(key, word, name) for key in _CONSOLE_KEYS for word in given]
    plain = () if most < Permission.ADMIN else (*_CONSOLE_KEYS, *_COMMAND_LINE_KEYS)
    watches = (_Rule(("put",), ("cw/*/data/local/webrtc_answer",)),) if most >= Permission.OPERATE else ()
    return (
        _Rule(("query",), ("fleet/*/history", *requested, *plain)),
        *watches,
        *((_START_TOKEN,) if plain else ()),
    )


def _person_rules(name: str, permission: Permission) -> tuple[_Rule, ...]:
    """Return the rules of a person: keys with the own name, on which the edge can answer with a reason.

    Without the permission to operate, a person must not set the instant of a common start, which would move
    the robots of others.
    """
    requested = [keys.as_person(key, name) for key in (*_CONSOLE_KEYS, keys.prepare("*", "*"))]
    together = (_Rule(("query",), (keys.starts("*"),)), _START_TOKEN)
    return (
        _NO_FRAMES,
        _Rule(("query",), ("fleet/*/history", *requested)),
        *(together if permission >= Permission.OPERATE else ()),
    )


def _worker_rules(name: str, edge: str) -> tuple[_Rule, ...]:
    """Return the rules of a worker of this edge: the keys of its robots, and its own heartbeat."""
    robots, own = f"fleet/{edge}/robots/*", f"fleet/{edge}/workers/{name}"
    return (
        _NO_FRAMES,
        _Rule(("liveliness_token",), (own, robots, f"fleet/{edge}/claims/*/*")),
        _Rule(_PUBLISH, (f"{own}/beat", f"{robots}/state", f"fleet/{edge}/places/{name}", _REPORTS)),
        _Rule(_PUBLISH, (f"fleet/{edge}/frames/{name}",)),
        _Rule(("query",), (f"{robots}/video",)),
        _Rule(_ANSWER, (f"{robots}/command", f"{robots}/state", f"fleet/{edge}/stop", _REPORTS)),
        _Rule(
            _ANSWER,
            (f"{robots}/command{keys.SENDER_SUFFIX}", f"{robots}/description", f"fleet/{edge}/history"),
        ),
        _Rule(
            _ANSWER, (f"{robots}/prepare", f"{robots}/prepare{keys.SENDER_SUFFIX}", f"fleet/{edge}/starts")
        ),
        _Rule(_ANSWER, (f"{own}/reload", f"{own}/hold")),
        _Rule((*_PUBLISH, *_ANSWER), ("cw/*/data/commands/**",), "deny"),
    )


def access_control(access: Access, edge: str, protocols: Iterable[str]) -> dict[str, object]:
    """Return Zenoh's access control for both sessions of an edge that speaks these protocols.

    A peer on a protocol without certificates may do everything: fleet.yaml admits it by a password or
    explicitly.
    """
    trusted = sorted(set(protocols) - _BY_CERTIFICATE)
    certified = sorted(_BY_CERTIFICATE)
    parts: dict[str, tuple[dict[str, list[str]], tuple[_Rule, ...]]] = {
        "here": ({"link_protocols": trusted}, (_Rule(_ALL, ("**",)), _COMMON[0])),
        "certificate": ({"link_protocols": certified}, _STOPS),
    }
    parts |= {
        f"identity {name}": (
            {"cert_common_names": [name], "link_protocols": certified},
            (*_COMMON, *rules_of(role, name, edge, access)),
        )
        for name, role in access.roles.items()
    }
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            rule.as_zenoh(f"{who} {number}")
            for who, (_, rules) in parts.items()
            for number, rule in enumerate(rules)
        ],
        "subjects": [{"id": who, **subject} for who, (subject, _) in parts.items()],
        "policies": [
            {"subjects": [who], "rules": [f"{who} {number}" for number in range(len(rules))]}
            for who, (_, rules) in parts.items()
        ],
    }
