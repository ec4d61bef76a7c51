"""The broker on a thread of its own, for tests and for programs without an event loop."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self, TypeVar

from fleet.runtime.event_loop import BackgroundLoop
from fleet.sim.broker.server import Broker

T = TypeVar("T")


class BrokerThread:
    """Runs a broker inside a ``with`` block; takes the arguments of ``Broker``."""

    def __init__(self, **arguments: Any) -> None:
        self.broker = Broker(**arguments)
        self._loop = BackgroundLoop("fleet-broker", asyncio.new_event_loop)
        self._stack = contextlib.ExitStack()

    @property
    def port(self) -> int:
        """Return the port on which the broker listens."""
        return self.broker.port

    def __enter__(self) -> Self:
        with contextlib.ExitStack() as stack:
            stack.enter_context(self._loop)
            self._loop.complete(self.broker.__aenter__())
            stack.callback(lambda: self._loop.complete(self.broker.__aexit__(None, None, None)))
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def call(self, function: Callable[..., T], *arguments: object) -> T:
        """Run a function on the broker's thread and return its result: ``call(broker.half_open, "a")``."""
        return self._loop.call(function, *arguments)
