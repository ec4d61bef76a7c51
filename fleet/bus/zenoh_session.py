"""A Zenoh session, reduced to the operations that the project uses. The only module that imports zenoh.

Callbacks are direct, except for ``gather``: they run on Zenoh's own threads, and synchronously for messages
that this session itself publishes. They must only store or hand over; a callback that blocks would delay
everything else that arrives on its link.
"""

from __future__ import annotations

import contextlib
import copy
import json
import logging
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import zenoh

from fleet.bus.keys import LOCAL
from fleet.errors import BusError

log = logging.getLogger(__name__)

OnSample = Callable[[str, bytes], None]
OnNoted = Callable[[bytes, bytes], None]
OnSamples = Callable[[list[tuple[str, bytes]]], None]
OnQuery = Callable[["Query"], None]

GATHERED = 128
"""Samples that may wait for the gathering thread; more wait in the socket, then publishers block.

Each sample may keep its 64 KiB receive buffer alive: a thousand of them took 30 MiB of a busy edge.
"""
AT_ONCE = 200
"""Maximum number of samples in one call."""
UNSURE = 100
"""Samples that a new publisher sends in any case: Zenoh reports its subscribers a moment later."""
CALL_END_TIMEOUT = 2.0
"""Seconds to wait, on close, for a call with samples to return."""


class Publisher:
    """A declared publisher to other sessions; ``wanted``: at least one of them subscribes to its key."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self.wanted = False
        self._publisher = session.declare_publisher(
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            allowed_destination=zenoh.Locality.REMOTE,
        )
        self._publisher.declare_matching_listener(_direct(self._changed))

    def put(self, payload: bytes) -> None:
        """Publish without blocking; dropped when the link is congested."""
        self._publisher.put(payload)

    def _changed(self, status: zenoh.MatchingStatus) -> None:
        """Record whether there is a subscriber; on Zenoh's thread."""
        self.wanted = status.matching


class Publishers:
    """Publishers of keys under ``pattern``; none is declared until one of the keys has a subscriber.

    Zenoh needs 3 kB for each, and on most edges the only subscriber is the bridge of their own process.
    """

    def __init__(self, session: zenoh.Session, pattern: str) -> None:
        self._session = session
        self._any = Publisher(session, pattern)
        self._made: dict[str, Publisher] = {}
        self._unsure: dict[str, int] = {}  # samples still to send without a known subscriber

    def wanted(self, key: str) -> Publisher | None:
        """Return the publisher of a key; None while it has no subscriber."""
        publisher = self._made.get(key)
        if publisher is None:
            if not self._any.wanted:
                return None
            publisher = self._made[key] = Publisher(self._session, key)
            self._unsure[key] = UNSURE
        if publisher.wanted:
            return publisher
        left = self._unsure.get(key, 0)
        if not left:
            return None
        self._unsure[key] = left - 1
        return publisher


class Query:
    """A received query; may be answered later, from any thread, more than once, until ``close``.

    ``key`` is the key of the queryable, ``requested`` the query's key expression (it may have wildcards).
    ``suffix`` is the additional part of the query's key (see ``ZenohSession.answer``); neither contains it.
    """

    def __init__(self, query: zenoh.Query, key: str, more: str = "") -> None:
        self._query: zenoh.Query | None = query
        self._open = [0]  # a number for each part that is open, see ``divided``; who takes the 0 ends it
        self.key = key
        self.requested, self.suffix = _parted(str(query.key_expr), more.count("/"))
        self.payload = query.payload.to_bytes() if query.payload is not None else b""
        pairs = str(query.parameters).split(";")
        self.parameters = {name: value for name, _, value in (pair.partition("=") for pair in pairs)}

    def reply(self, payload: bytes, key: str | None = None) -> None:
        """Send one reply (on ``key``, for a query to many); does nothing once the query is closed."""
        if self._query is not None:
            self._query.reply((key or self.key) + self.suffix, payload)

    def answer(self, payload: bytes, key: str | None = None) -> None:
        """Send the only reply."""
        self.reply(payload, key)
        self.close()

    def split(self, keys: Sequence[str]) -> list[Query]:
        """Return a query for each of these keys, in place of this one; the last to be closed ends it."""
        self._open = list(range(len(keys)))
        parts = [copy.copy(self) for _ in keys]
        for part, key in zip(parts, keys, strict=True):
            part.key = key
        self._query = None
        return parts

    def close(self) -> None:
        """End the replies to this query."""
        query, self._query = self._query, None
        if query is not None and self._open.pop() == 0:
            query.drop()


class ZenohSession:
    """An open session; ``settings`` are Zenoh's own, by path. Raises BusError when it cannot open."""

    def __init__(self, settings: Mapping[str, object]) -> None:
        try:
            self._session = zenoh.open(_config(settings))
        except zenoh.ZError as error:
            raise BusError(f"the bus cannot be opened: {_first_line(error)}") from None
        self.identity, self.person = LOCAL, ""  # the name in its certificate; again, if it is a person's
        self._kept: list[object] = []
        self._threads: list[threading.Thread] = []

    def close(self) -> None:
        """Close the session; its tokens and queryables disappear immediately."""
        self._kept.clear()
        self._session.close()
        # A thread that returns from Zenoh after the interpreter has ended would abort the process.
        for thread in tuple(self._threads):
            thread.join(CALL_END_TIMEOUT)

    def reached(self) -> list[str]:
        """Return the endpoints of all links that are up, as Zenoh writes them (names are resolved)."""
        return [link.dst for link in self._session.info.links()]

    def publisher(self, key: str) -> Publisher:
        """Declare a publisher for state, to other sessions: never blocks, drops on congestion."""
        return Publisher(self._session, key)

    def publishers(self, pattern: str) -> Publishers:
        """Return such publishers for all keys under a pattern, declared as needed."""
        return Publishers(self._session, pattern)

    def put(self, key: str, payload: bytes, *, urgent: bool = False, note: bytes | None = None) -> None:
        """Publish once; ``urgent`` messages overtake all others and are not dropped.

        A ``note`` is attached to the payload, in the same message; see ``subscribe_noted``.
        """
        if urgent:
            self._session.put(
                key,
                payload,
                priority=zenoh.Priority.REAL_TIME,
                congestion_control=zenoh.CongestionControl.BLOCK,
                express=True,
                attachment=note,
            )
        else:
            self._session.put(key, payload, attachment=note)

    def subscribe(self, key: str, call: OnSample) -> Callable[[], None]:
        """Call ``call`` with key and payload of each sample under ``key``; return a function that ends it."""
        arrived = _direct(lambda sample: call(*_read(sample)))
        return self._keep(self._session.declare_subscriber(key, arrived))

    def _keep(self, *declared: Any) -> Callable[[], None]:
        """Keep declarations until the session is closed; return a function that ends them before."""
        self._kept += declared
        return partial(self._end, declared)

    def _end(self, declared: Iterable[Any]) -> None:
        """End declarations; no effect on those that have ended."""
        for each in declared:
            if each in self._kept:
                self._kept.remove(each)
                each.undeclare()

    def subscribe_noted(self, key: str, call: OnNoted) -> None:
        """Call ``call`` with payload and note of each sample under ``key``; the note is empty if absent."""

        def arrived(sample: zenoh.Sample) -> None:
            note = sample.attachment
            call(sample.payload.to_bytes(), note.to_bytes() if note is not None else b"")

        self._kept.append(self._session.declare_subscriber(key, _direct(arrived)))

    def subscribe_many(
        self, pattern: str, calls: Mapping[str, Callable[[bytes], None]]
    ) -> Callable[[], None]:
        """Call the function in ``calls`` for the key of each sample published under ``pattern``.

        Return a function that ends it; ``calls`` may change meanwhile. This is one subscription, not one per
        key: a session compares every received sample with all its subscriptions.
        """

        def arrived(key: str, payload: bytes) -> None:
            call = calls.get(key)
            if call is not None:
                call(payload)

        return self.subscribe(pattern, arrived)

    def subscribe_batches(self, key: str, call: OnSamples) -> Callable[[], None]:
        """Call ``call`` with batches of the samples of other sessions under ``key``, in order.

        Return a function that ends it; a last call may come while that runs. The calls are made on a thread
        of their own and may work, but not wait. A callback per sample would take the GIL from the running
        thread each time, which costs more than the work itself at high rates.
        """
        origin = zenoh.Locality.REMOTE
        samples = self._session.declare_subscriber(
            key, zenoh.handlers.FifoChannel(GATHERED), allowed_origin=origin
        )
        undeclare = self._keep(samples)
        work = (samples.handler, _guarded(call))
        thread = threading.Thread(target=_gather, args=work, name="fleet-bus", daemon=True)
        self._threads.append(thread)
        thread.start()

        def end() -> None:
            undeclare()
            if thread in self._threads:
                thread.join(CALL_END_TIMEOUT)
                self._threads.remove(thread)

        return end

    def declare_queryable(self, key: str, call: OnQuery, *, more: str = "") -> Callable[[], None]:
        """Call ``call`` with each query on ``key``; it, or other code later, must reply to and close it.

        With ``more`` (``/as/*/*``) also on keys with these additional chunks. Return a function that ends it.
        """

        def declared(suffix: str) -> Any:
            requested = _direct(lambda query: call(Query(query, key, suffix)))
            return self._session.declare_queryable(key + suffix, requested)

        return self._keep(*map(declared, {"", more}))

    def request(
        self,
        key: str,
        payload: bytes,
        *,
        timeout: float,
        parameters: Mapping[str, str] | None = None,
        urgent: bool = False,
    ) -> Iterator[tuple[str, bytes]]:
        """Send a query at once; return an iterator of its replies (key, payload), for up to ``timeout`` s."""
        replies = self._session.get(
            key + _parameters(parameters),
            payload=payload,
            timeout=timeout,
            consolidation=zenoh.ConsolidationMode.NONE,
            priority=zenoh.Priority.REAL_TIME if urgent else zenoh.Priority.INTERACTIVE_HIGH,
            express=True,
        )
        return _answers(replies)

    def request_later(
        self,
        key: str,
        payload: bytes,
        *,
        timeout: float,
        parameters: Mapping[str, str] | None = None,
        on_answer: Callable[[bytes], None],
        on_end: Callable[[], None],
    ) -> None:
        """Send a query without waiting; both callbacks run on Zenoh's threads and must only hand over."""

        def answered(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                on_answer(reply.ok.payload.to_bytes())

        self._session.get(
            key + _parameters(parameters),
            _direct(answered, on_end),
            payload=payload,
            timeout=timeout,
            consolidation=zenoh.ConsolidationMode.NONE,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            express=True,
        )

    def token(self, key: str) -> Callable[[], None]:
        """Declare a liveliness token on ``key``; return a function that withdraws it."""
        return self._keep(self._session.liveliness().declare_token(key))

    def tokens(self, key: str, *, timeout: float) -> list[str]:
        """Return the keys of the live tokens; waits for all answers, up to ``timeout`` s."""
        return [key for key, _ in _answers(self._session.liveliness().get(key, timeout=timeout))]

    def watch_tokens(self, key: str, call: Callable[[str, bool], None]) -> Callable[[], None]:
        """Call ``call`` with each token's key and whether it lives, now and at changes; return its end."""

        def changed(sample: zenoh.Sample) -> None:
            call(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        return self._keep(self._session.liveliness().declare_subscriber(key, _direct(changed), history=True))


def _config(settings: Mapping[str, object]) -> zenoh.Config:
    """Return Zenoh's configuration; raises BusError that names a setting which Zenoh rejects."""
    config = zenoh.Config()
    for path, value in settings.items():
        try:
            config.insert_json5(path, json.dumps(value))
        except zenoh.ZError:
            raise BusError(f"the bus cannot be opened: {path} cannot be {value!r}") from None
    return config


def keys_intersect(one: str, other: str) -> bool:
    """Return True when two key expressions have a key in common."""
    return zenoh.KeyExpr(one).intersects(zenoh.KeyExpr(other))


def _parted(requested: str, chunks: int) -> tuple[str, str]:
    """Return a key expression without its last chunks, and these with the slashes before them."""
    parts = requested.split("/")
    keep = len(parts) - chunks
    return "/".join(parts[:keep]), "".join(f"/{part}" for part in parts[keep:])


def _read(sample: zenoh.Sample) -> tuple[str, bytes]:
    """Return key and payload of a sample."""
    return str(sample.key_expr), sample.payload.to_bytes()


def _gather(samples: Any, call: OnSamples) -> None:
    """Body of the gathering thread: take samples until the session is closed."""
    with contextlib.suppress(zenoh.ZError):
        while True:
            gathered = [_read(samples.recv())]
            try:
                while len(gathered) < AT_ONCE and (sample := samples.try_recv()) is not None:
                    gathered.append(_read(sample))
            finally:
                call(gathered)


def _answers(replies: Iterable[zenoh.Reply]) -> Iterator[tuple[str, bytes]]:
    """Yield key and payload of each reply that is not an error."""
    for reply in replies:
        if reply.ok is not None:
            yield str(reply.ok.key_expr), reply.ok.payload.to_bytes()


def _direct(call: Callable[[Any], None], end: Callable[[], None] | None = None) -> Any:
    """Return a handler that runs on Zenoh's thread, without a queue."""
    return zenoh.handlers.Callback(_guarded(call), end and _guarded(end), indirect=False)


def _guarded(call: Callable[..., None]) -> Callable[..., None]:
    """Return a callback whose exceptions are logged and do not reach Zenoh."""

    def guarded(*arguments: Any) -> None:
        try:
            call(*arguments)
        except Exception:  # other subscribers of this process must still be served
            log.exception("a bus callback failed")

    return guarded


def _parameters(parameters: Mapping[str, str] | None) -> str:
    """Return the parameters part of a selector."""
    if not parameters:
        return ""
    return "?" + ";".join(f"{name}={value}" for name, value in parameters.items())


def _first_line(error: BaseException) -> str:
    """Return the part of Zenoh's message that gives the reason."""
    return str(error).split(" at /")[0].splitlines()[0]
