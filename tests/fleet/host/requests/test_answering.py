"""When a question of the bus is closed: with its receipt, or for whoever waits with the end."""

import msgspec
import pytest

from fleet.host.requests.answering import answer_to
from fleet.model.command import Reply, ReplyStatus


class Question:
    """A question that keeps its answers."""

    def __init__(self):
        self.answers, self.is_closed = [], False

    def reply(self, payload):
        self.answers.append(msgspec.json.decode(payload, type=Reply))

    def close(self):
        self.is_closed = True


BEGUN = Reply("walk", ReplyStatus.ACCEPTED)
ENDED = Reply("walk", ReplyStatus.ACCEPTED, done=True)
REFUSED = Reply("walk", ReplyStatus.REJECTED, "not today")


@pytest.mark.parametrize(
    ("waits", "reply", "closed"),
    [
        (False, BEGUN, True),
        (True, BEGUN, False),
        (True, ENDED, True),
        (True, REFUSED, True),
    ],
)
def test_a_question_is_closed_by_its_last_answer(waits, reply, closed):
    question = Question()
    answer_to(question, waits=waits)(reply)
    assert question.answers == [reply]
    assert question.is_closed is closed
