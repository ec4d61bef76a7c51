"""Removal of the secrets of fleet.yaml, secrets.yaml and the environment from exported text."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from urllib.parse import quote

import yaml

from fleet.config.nodes import BadYaml, compose, decoded
from fleet.config.problems import is_secret, masked
from fleet.config.yaml import SHORTEST_SECRET, Document

MASK = "****"
_USER_IN_URL = re.compile(r"(://)[^/\s:@\"']*:[^/\s@\"']+@")
_BEARER = re.compile(r"(?i)\b(bearer|basic)\s+[A-Za-z0-9._~+/=-]{8,}")


class Masking:
    """Masks ``secrets`` in plain, JSON, URL and Python notation, and credentials in URLs and headers."""

    def __init__(self, secrets: Iterable[str]) -> None:
        forms = {form for secret in secrets for form in _forms(secret)}
        longest_first = sorted(forms, key=len, reverse=True)
        self._known = re.compile("|".join(map(re.escape, longest_first))) if forms else None

    def text(self, text: str) -> str:
        """Return text without secrets."""
        if self._known is not None:
            text = self._known.sub(MASK, text)
        return _BEARER.sub(rf"\1 {MASK}", _USER_IN_URL.sub(rf"\1{MASK}@", text))

    def finds(self, content: bytes) -> bool:
        """Return True if a file contains one of the secrets."""
        return self._known is not None and self._known.search(content.decode(errors="replace")) is not None

    def config(self, lines: Iterable[str]) -> str:
        """Return a configuration file without secrets and without values of secret keys."""
        return "".join(f"{self.text(masked(line.rstrip()))}\n" for line in lines)


def secrets_in(document: Document, kept: Iterable[str], environ: Mapping[str, str]) -> set[str]:
    """Return the values that must not leave this computer.

    These are the values from ``!secret`` and secret variables, ``kept`` (the values of secrets.yaml), values
    of keys that name a secret, webhook addresses, and all variables whose name is that of a secret.
    """
    found = {*document.secrets, *kept, *_under_secret_keys(document.data)}
    found |= {value for name, value in environ.items() if is_secret(name)}
    notify = document.data.get("notify") if isinstance(document.data, dict) else None
    targets = notify if isinstance(notify, list) else []
    found |= {str(each["url"]) for each in targets if isinstance(each, dict) and each.get("url")}
    return found


def kept_secrets(path: Path) -> list[str]:
    """Return the values of a secrets file, even if it is invalid; empty without a file."""
    try:
        content = path.read_bytes()
    except OSError:
        return []
    lines = content.decode(errors="replace").splitlines()
    found = [line.partition(":")[2].strip().strip("\"'") for line in lines]
    with contextlib.suppress(BadYaml):
        found += _scalars(compose(decoded(content)))
    return [value for value in found if value]


def _scalars(node: yaml.Node | None) -> list[str]:
    """Return the values of a mapping and of nested mappings."""
    if isinstance(node, yaml.MappingNode):
        return [each for _, value in node.value for each in _scalars(value)]
    return [node.value] if isinstance(node, yaml.ScalarNode) else []


def _under_secret_keys(value: object, *, secret: bool = False) -> Iterator[str]:
    """Yield the values of keys that name secrets."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _under_secret_keys(part, secret=secret or is_secret(str(key)))
    elif isinstance(value, list):
        for part in value:
            yield from _under_secret_keys(part, secret=secret)
    elif secret and value is not None and not isinstance(value, bool):
        yield str(value)


def _forms(secret: str) -> Iterator[str]:
    """Yield a secret and each of its lines in all notations."""
    for part in {secret, secret.strip(), *secret.splitlines()}:
        for form in (
            part,
            json.dumps(part)[1:-1],
            json.dumps(part, ensure_ascii=False)[1:-1],
            quote(part),
            quote(part, safe=""),
            repr(part)[1:-1],
        ):
            if len(form) >= SHORTEST_SECRET:
                yield form
