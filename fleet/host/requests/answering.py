"""Answers to questions of the bus: the receipt and, for whoever waits, the end."""

from __future__ import annotations

import msgspec

from fleet.bus.zenoh_session import Query
from fleet.model.command import Answer, Reply


def answer_to(question: Query, *, waits: bool) -> Answer:
    """Return what answers a question, and closes it with the last answer."""

    def answer(reply: Reply) -> None:
        question.reply(msgspec.json.encode(reply))
        if not (waits and reply.ok and reply.done is None):
            question.close()

    return answer
