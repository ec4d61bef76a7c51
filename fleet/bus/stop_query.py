"""The query that stops robots over the bus, as commands and the console send it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession

ANSWER_WITHIN = 2.0  # s for the answers of the edges
AGAIN = 0.05  # s until a stop that nobody answered is sent again


def query_stop(
    session: ZenohSession, edge: str, payload: bytes, parameters: Mapping[str, str]
) -> Iterator[tuple[str, bytes]]:
    """Send a stop to an edge (``*``: to all), and yield the answers: key, and the stopped robots as JSON.

    An edge that starts can be joined before its key for stops is known to the session: Zenoh then ends the
    query at once, without an answer. It is repeated until an edge answers, for ``ANSWER_WITHIN``.
    """
    end = time.monotonic() + ANSWER_WITHIN
    while (remaining := end - time.monotonic()) > 0:
        is_answered = False
        for answer in session.request(
            keys.stop(edge), payload, timeout=remaining, parameters=parameters, urgent=True
        ):
            is_answered = True
            yield answer
        if is_answered:
            return
        time.sleep(AGAIN)
