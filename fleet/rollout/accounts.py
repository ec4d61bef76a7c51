"""The accounts of a NATS server for roll-outs: what an edge, and who rolls out, may read and write. Pure.

Permissions of a user do not bound where the answer to its request goes, and an answer is a message like
any other: in one account with the store, an edge could lead the answer to a subject that it may not write.
So each edge has an account of its own, which imports single services of the store's account; its answers
stay there.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping

import msgspec

from fleet.errors import FleetError
from fleet.rollout.names import BUNDLES, DESIRED, OBSERVED, OPERATOR, inbox_of, subject

STORE = "FLEET_STORE"  # the account of the store, and of who rolls out
_EDGE = re.compile(r"[a-z][a-z0-9_-]{0,62}")
_OPERATOR = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,62}")


class AccountsError(FleetError):
    """The accounts of a server cannot be made of these names."""


def edge_services(edge: str) -> list[str]:
    """Return the subjects that an edge may use: its own desired state, bundles, its own observed state."""
    return [
        f"$JS.API.DIRECT.GET.KV_{DESIRED}.{subject(DESIRED, edge)}",
        f"$JS.API.DIRECT.GET.KV_{BUNDLES}.{subject(BUNDLES, '*.*')}",
        subject(OBSERVED, edge),
    ]


def edge_account(edge: str) -> str:
    """Return the name of an edge's account."""
    return f"FLEET_EDGE_{edge}"


def edge_permissions(edge: str) -> dict[str, object]:
    """Return what the user of an edge may do in its account."""
    return {
        "publish": {"allow": edge_services(edge)},
        "subscribe": {"allow": [f"{inbox_of(edge)}.>"]},
    }


def operator_permissions() -> dict[str, object]:
    """Return what who rolls out may do; it can read and write all buckets of roll-outs."""
    return {
        "publish": {"allow": ["$JS.API.>", "$KV.>"]},
        "subscribe": {"allow": [f"{inbox_of(OPERATOR)}.>"]},
    }


def server_accounts(edges: Iterable[str], operators: Iterable[str]) -> str:
    """Return the block of a NATS server's configuration with an account for the store and for each edge.

    With ``verify_and_map`` in its block ``tls`` the users are known by the name in their certificates.
    Raises AccountsError for a name that could mean more than one account.
    """
    edges, operators = tuple(edges), tuple(operators)
    _check(edges, operators)
    services = {edge: edge_services(edge) for edge in edges}
    allowed: dict[str, list[str]] = {}
    for edge, subjects in services.items():
        for each in subjects:
            allowed.setdefault(each, []).append(edge_account(edge))
    accounts: dict[str, Mapping[str, object]] = {
        STORE: {
            "jetstream": "enabled",
            "users": [{"user": name, "permissions": operator_permissions()} for name in operators],
            "exports": [{"service": each, "accounts": names} for each, names in allowed.items()],
        }
    }
    for edge, subjects in services.items():
        accounts[edge_account(edge)] = {
            "users": [{"user": edge, "permissions": edge_permissions(edge)}],
            "imports": [{"service": {"account": STORE, "subject": each}} for each in subjects],
        }
    lines = ",\n".join(f"  {_text(name)}: {_text(account)}" for name, account in accounts.items())
    return f"accounts {{\n{lines}\n}}\n"


def _check(edges: tuple[str, ...], operators: tuple[str, ...]) -> None:
    """Refuse names that are none, as ``*``, or stand twice."""
    for what, pattern, names in (("edge", _EDGE, edges), ("operator", _OPERATOR, operators)):
        for name in names:
            if pattern.fullmatch(name) is None:
                raise AccountsError(f"{name!r} is no name of an {what}: use letters, digits, - and _")
    twice = [name for name, times in Counter((*edges, *operators)).items() if times > 1]
    if twice:
        raise AccountsError(f"{twice[0]} is named twice: each edge and operator has one account")


def _text(value: object) -> str:
    """Return a value as the server's configuration reads it."""
    return msgspec.json.encode(value).decode()
