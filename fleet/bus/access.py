"""What each identity may do on the bus, as Zenoh's access control wants to hear it.

An identity is the common name of a certificate. Everything is refused that is not written here. The rules
stand for as long as a session lives, so they name keys by pattern and no robot: one that is added needs no
new rules. Programs on this computer come by Unix sockets, which are their user's alone, and may do
everything.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

import msgspec

from fleet.config.endpoints import Role

PROGRAM_CHANNELS = (
    "commands",
    "depth",
    "driverlog",
    "event",
    "frames",
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
"""What a program says of a twin: what it found with its sensors, and velocities. A robot's own state is not
among it."""

_REPORTS = "cw/*/data/**"
_STOP = "fleet/*/stop"
_DESCRIPTION = "fleet/*/robots/*/description"
_MISSIONS = ("fleet/*/missions/*", "fleet/*/runs/*")
_BY_CERTIFICATE = frozenset({"tls", "quic"})

_LISTEN = ("declare_subscriber", "liveliness_query", "declare_liveliness_subscriber")
_SAY = ("put", "delete")
_ANSWER = ("declare_queryable", "reply")
_ALL = (*_SAY, "query", *_ANSWER, "liveliness_token", *_LISTEN)


class Access(msgspec.Struct, frozen=True):
    """Who may do what on an edge's bus: a role by common name.

    ``twins`` are the edge's own, of which other edges say nothing; ``channels`` those that programs may use
    besides ``PROGRAM_CHANNELS``.
    """

    roles: Mapping[str, Role]
    twins: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()


class _Rule(msgspec.Struct, frozen=True):
    """Messages that may, or must not, come in on some keys."""

    messages: tuple[str, ...]
    keys: tuple[str, ...]
    permission: Literal["allow", "deny"] = "allow"
    flow: Literal["ingress", "egress"] = "ingress"

    def as_zenoh(self, name: str) -> dict[str, object]:
        """Return the rule in Zenoh's words."""
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
)
"""Everybody with a role hears everything and asks how things are."""

_STOPS = (
    _Rule(("put", "query"), (_STOP,)),
    _Rule(("reply", "declare_subscriber", "declare_queryable"), (_STOP,), flow="egress"),
)
"""Whoever shows a certificate of the site may stop (ADR 0010), role or none."""


def rules_of(role: Role, name: str, edge: str, access: Access) -> tuple[_Rule, ...]:
    """Return what one identity may do on the bus of an edge besides what all may."""
    if role == "router":
        return (_Rule(_ALL, ("**",)),)
    if role == "console":
        robots = ("fleet/*/robots/*/command", "fleet/*/robots/*/prepare")
        asked = (*robots, "fleet/*/starts", "fleet/*/history", "fleet/*/schedules", *_MISSIONS)
        return (_Rule(("query",), asked), _Rule(("liveliness_token",), ("fleet/*/starts/*",)))
    if role == "program":
        channels = (*PROGRAM_CHANNELS, *access.channels)
        return (
            _Rule((*_SAY, *_ANSWER), tuple(f"cw/*/data/{channel}/**" for channel in channels)),
            _Rule(_ANSWER, ("fleet/*/robots/*/video",)),
        )
    if role == "worker":
        return _worker_rules(name, edge)
    foreign = tuple(f"cw/{twin}/data/**" for twin in access.twins)
    own = (f"fleet/{name}", f"fleet/{name}/**")
    return (
        _Rule((*_SAY, *_ANSWER, "liveliness_token"), own),
        _Rule((*_SAY, *_ANSWER), (_REPORTS,)),
        _Rule((*_SAY, *_ANSWER), ("cw/*/data/commands/**", *foreign), "deny"),
    )


def _worker_rules(name: str, edge: str) -> tuple[_Rule, ...]:
    """Return what a worker of this edge may do: what is its robots', and its own beat."""
    robots, own = f"fleet/{edge}/robots/*", f"fleet/{edge}/workers/{name}"
    return (
        _Rule(("liveliness_token",), (own, robots, f"fleet/{edge}/claims/*/*")),
        _Rule(_SAY, (f"{own}/beat", f"{robots}/state", f"fleet/{edge}/places/{name}", _REPORTS)),
        _Rule(("query",), (f"{robots}/video",)),
        _Rule(_ANSWER, (f"{robots}/command", f"{robots}/state", f"fleet/{edge}/stop", _REPORTS)),
        _Rule(_ANSWER, (f"{robots}/description", f"fleet/{edge}/history")),
        _Rule(_ANSWER, (f"{robots}/prepare", f"fleet/{edge}/starts")),
        _Rule((*_SAY, *_ANSWER), ("cw/*/data/commands/**",), "deny"),
    )


def access_control(access: Access, edge: str, protocols: Iterable[str]) -> dict[str, object]:
    """Return Zenoh's access control for both sessions of an edge that speaks these protocols.

    Who comes by a protocol that shows no certificate may do everything: fleet.yaml has let it in by a
    password, or in so many words.
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
