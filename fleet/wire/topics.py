"""MQTT topics and bus keys of a twin: built and parsed in one place.

Topics are ``{prefix}cyberwave/twin/{twin}/{suffix}``. Those of other namespaces,
``{prefix}cyberwave/{namespace}/{uuid}/{rest}``, have the suffix ``namespace:rest``: ``joint:update``,
``ping:request``, ``environment:update``. The prefix is prepended as it is, without a separator.
Bus keys are ``cw/{twin}/data/{channel}[/{sensor}]``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import msgspec

from fleet.errors import ConfigError, WireError

JOINT_UPDATE = "joint:update"
NAMESPACES = frozenset({"joint", "environment", "ping", "pong", "workflow", "workflow-run"})
"""Topic levels that can replace ``twin``."""

_TWIN = re.compile(r"[0-9a-fA-F]{8}(?:-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}")
_LEAF = re.compile(r"[^/+#\0\s:]+(?:/[^/+#\0\s:]+)*")
_WORD = re.compile(r"[a-z][a-z0-9_]*")
_CHANNEL = re.compile(r"[a-z][a-z0-9_]*(?:/[a-z][a-z0-9_]*)?")
_SEGMENT = re.compile(r"[^/+#\0]+")


class Topic(msgspec.Struct, frozen=True):
    """A parsed topic; ``twin`` is the uuid in it, in other namespaces not that of a twin."""

    twin: str
    suffix: str


class DataKey(msgspec.Struct, frozen=True):
    """A parsed bus key; the channels ``commands/...`` have two segments, all others have one."""

    twin: str
    channel: str
    sensor: str | None = None


def prefix_from(explicit: str | None, environ: Mapping[str, str]) -> str:
    """Return the topic prefix: the configured one, else the first variable of the SDK that is set.

    The order is CYBERWAVE_MQTT_TOPIC_PREFIX, CYBERWAVE_TOPIC_PREFIX, then CYBERWAVE_ENVIRONMENT unless
    that is ``production``. An explicit empty string means no prefix.
    """
    if explicit is not None:
        return explicit
    named = environ.get("CYBERWAVE_MQTT_TOPIC_PREFIX") or environ.get("CYBERWAVE_TOPIC_PREFIX")
    if named:
        return named
    environment = environ.get("CYBERWAVE_ENVIRONMENT", "").strip()
    return "" if environment.lower() == "production" else environment


def _checked_twin(twin: str) -> str:
    """Return ``twin``; raises WireError unless it is a uuid, which cannot hold a wildcard."""
    if not _TWIN.fullmatch(twin):
        raise WireError(f"{twin[:60]!a} is not the uuid of a twin")
    return twin


class Topics:
    """Topics under one prefix; raises ConfigError for a prefix with a wildcard or white space."""

    def __init__(self, prefix: str) -> None:
        if re.search(r"[+#\0\s]", prefix):
            raise ConfigError(f"topic prefix {prefix!a}: no +, # or white space may stand in it")
        self.prefix = prefix
        self._root = f"{prefix}cyberwave/"

    def twin(self, twin_uuid: str, suffix: str) -> str:
        """Return the topic of a suffix, in any namespace; raises WireError for a wildcard in either."""
        namespace, rest = _split(suffix)
        if not _LEAF.fullmatch(rest):
            raise WireError(f"{suffix[:60]!a} cannot be a topic")
        return f"{self._root}{namespace}/{_checked_twin(twin_uuid)}/{rest}"

    def joint(self, twin_uuid: str) -> str:
        """Return the topic on which the joints of a twin are reported and commanded."""
        return self.twin(twin_uuid, JOINT_UPDATE)

    def edge(self, edge_id: str) -> str:
        """Return the topic of an edge's health; the contract has its commands beside it."""
        return f"{self.prefix}edges/{edge_id}/health"

    def filter(self, suffix: str, twin_uuid: str | None = None) -> str:
        """Return the topic filter for one of this project's suffixes, for one twin or for all.

        The suffix may end in ``+``, for one level.
        """
        namespace, rest = _split(suffix)
        place = "+" if twin_uuid is None else _checked_twin(twin_uuid)
        return f"{self._root}{namespace}/{place}/{rest}"

    def parse(self, topic: str) -> Topic | None:
        """Parse a topic; None for another prefix, an unknown namespace, or a malformed topic."""
        if not topic.startswith(self._root):
            return None
        namespace, _, tail = topic[len(self._root) :].partition("/")
        twin, _, rest = tail.partition("/")
        if not (_TWIN.fullmatch(twin) and _LEAF.fullmatch(rest)):
            return None
        if namespace == "twin":
            return Topic(twin, rest)
        return Topic(twin, f"{namespace}:{rest}") if namespace in NAMESPACES else None

    def is_own_inbox(self, response_topic: str, twin_uuid: str) -> bool:
        """Return True when a Response Topic is a reply inbox of this twin.

        That is ``command/{client_id}/response`` with one client id. A request must not be able to make the
        edge publish anywhere else.
        """
        head, tail = f"{self.twin(twin_uuid, 'command')}/", "/response"
        if not (response_topic.startswith(head) and response_topic.endswith(tail)):
            return False
        return bool(_SEGMENT.fullmatch(response_topic[len(head) : -len(tail)]))


def _split(suffix: str) -> tuple[str, str]:
    """Return the namespace of a suffix, and the part of the topic after the uuid."""
    namespace, colon, rest = suffix.partition(":")
    return (namespace, rest) if colon and namespace in NAMESPACES else ("twin", suffix)


def data_key(twin: str, channel: str, sensor: str | None = None) -> str:
    """Return the bus key of a channel; raises WireError for a name that the SDK could not parse."""
    if not _CHANNEL.fullmatch(channel):
        raise WireError(f"{channel[:60]!a} is not a channel")
    if sensor is None:
        return f"cw/{_checked_twin(twin)}/data/{channel}"
    if not _WORD.fullmatch(sensor) or "/" in channel:
        raise WireError(f"{sensor[:60]!a} cannot be a sensor of {channel}")
    return f"cw/{_checked_twin(twin)}/data/{channel}/{sensor}"


def parse_data_key(key: str) -> DataKey | None:
    """Parse a bus key; None for any other key."""
    segments = key.split("/")
    if not 4 <= len(segments) <= 5 or segments[0] != "cw" or segments[2] != "data":
        return None
    twin, names = segments[1], segments[3:]
    if not _TWIN.fullmatch(twin) or not all(_WORD.fullmatch(name) for name in names):
        return None
    if names[0] == "commands":
        return DataKey(twin, "/".join(names))
    return DataKey(twin, names[0], names[1] if len(names) == 2 else None)
