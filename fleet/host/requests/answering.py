"""Answers to queries of the bus: the receipt, and the final result for a sender that waits."""

from __future__ import annotations

import msgspec

from fleet.bus.zenoh_session import Query
from fleet.model.command import Answer, Reply


def answer_to(question: Query, *, waits: bool) -> Answer:
    """Return the function that answers a query; it closes the query with the last answer."""

    def answer(reply: Reply) -> None:
        question.reply(msgspec.json.encode(reply))
        if not (waits and reply.ok and reply.done is None):
            question.close()

    return answer
