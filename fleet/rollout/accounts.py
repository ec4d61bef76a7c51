"""Accounts of a NATS server for roll-outs: permissions of edges and operators. Pure.

The permissions of a NATS user do not restrict the reply subject of its requests, and a reply is a message
like any other. In the account of the store, an edge could direct a reply to a subject that it may not
publish to. Therefore each edge has its own account, which imports single services from the account of the
store; replies to the edge stay in its account.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping

import msgspec

from fleet.errors import FleetError
from fleet.rollout.names import BUNDLES, DESIRED, OBSERVED, OPERATOR, inbox_of, subject

STORE = "FLEET_STORE"  # the account of the store and of the operators
_EDGE = re.compile(r"[a-z][a-z0-9_-]{0,62}")
_OPERATOR = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,62}")


class AccountsError(FleetError):
    """A name of an edge or operator is invalid or ambiguous as an account name."""


def edge_subjects(edge: str) -> list[str]:
    """Return the subjects of an edge: requests for its desired state and for bundles, its report."""
    return [
        f"$JS.API.DIRECT.GET.KV_{DESIRED}.{subject(DESIRED, edge)}",
        f"$JS.API.DIRECT.GET.KV_{BUNDLES}.{subject(BUNDLES, '*.*')}",
        subject(OBSERVED, edge),
    ]


def edge_account(edge: str) -> str:
    """Return the name of the account of an edge."""
    return f"FLEET_EDGE_{edge}"


def edge_permissions(edge: str) -> dict[str, object]:
    """Return the permissions of the user of an edge, in the account of that edge."""
    return {
        "publish": {"allow": edge_subjects(edge)},
        "subscribe": {"allow": [f"{inbox_of(edge)}.>"]},
    }


def operator_permissions() -> dict[str, object]:
    """Return the permissions of an operator, who reads and writes all buckets of roll-outs."""
    return {
        "publish": {"allow": ["$JS.API.>", "$KV.>"]},
        "subscribe": {"allow": [f"{inbox_of(OPERATOR)}.>"]},
    }


def server_accounts(edges: Iterable[str], operators: Iterable[str]) -> str:
    """Return the ``accounts`` block of a NATS server configuration: one account for the store, one per edge.

    With ``verify_and_map`` in its ``tls`` block, the server identifies users by the name in their
    certificates. Raises AccountsError for an invalid name, and for one that is given twice.
    """
    edges, operators = tuple(edges), tuple(operators)
    _check(edges, operators)
    services = {edge: edge_subjects(edge) for edge in edges}
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
    """Check the names; raises AccountsError for an invalid one, such as ``*``, and for a repeated one."""
    for what, pattern, names in (("edge", _EDGE, edges), ("operator", _OPERATOR, operators)):
        for name in names:
            if pattern.fullmatch(name) is None:
                raise AccountsError(f"{name!r} is no name of an {what}: use letters, digits, - and _")
    twice = [name for name, times in Counter((*edges, *operators)).items() if times > 1]
    if twice:
        raise AccountsError(f"{twice[0]} is named twice: each edge and operator has one account")


def _text(value: object) -> str:
    """Return a value in the syntax of the server configuration, which accepts JSON."""
    return msgspec.json.encode(value).decode()
