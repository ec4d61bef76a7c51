import weakref

import pytest

from fleet.errors import Fault, LinkLost, NotReady, Refused, TimedOut, Unsupported
from fleet.host.requests.receipt import Receipt
from fleet.model.command import ReplyStatus


def receipt(*, waits=False):
    answers = []
    return Receipt("land", answers.append, waits=waits), answers


def test_what_was_done_is_answered_once_to_who_does_not_wait():
    one, answers = receipt()
    one.accept()
    one.accept()
    one.done()
    assert [(answer.status, answer.done) for answer in answers] == [(ReplyStatus.ACCEPTED, None)]


def test_who_waits_gets_the_receipt_and_one_end():
    one, answers = receipt(waits=True)
    one.accept()
    one.reject("superseded")
    one.done()
    assert [(answer.ok, answer.done) for answer in answers] == [(True, None), (False, False)]


@pytest.mark.parametrize("waits", [False, True])
def test_what_was_asked_for_is_in_the_one_answer(waits):
    one, answers = receipt(waits=waits)
    one.done({"ready": False})
    assert [(answer.ok, answer.done, answer.data) for answer in answers] == [(True, True, {"ready": False})]


def test_who_waits_gets_what_was_asked_for_at_the_end_of_what_took_long():
    one, answers = receipt(waits=True)
    one.accept()
    one.done([1])
    assert [(answer.done, answer.data) for answer in answers] == [(None, None), (True, [1])]


def test_a_repeat_gets_what_was_asked_for_too():
    first, _ = receipt()
    again, answers = receipt()
    again.follow(first)
    first.done({"ready": True})
    late, late_answers = receipt()
    late.follow(first)
    assert [answer.data for answer in answers + late_answers] == [{"ready": True}] * 2


def test_a_refusal_is_receipt_and_end_in_one():
    one, answers = receipt(waits=True)
    one.reject("no", hint="later")
    one.done()
    assert [(answer.status, answer.reason, answer.hint) for answer in answers] == [
        (ReplyStatus.REJECTED, "no", "later")
    ]


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (Unsupported("x"), ReplyStatus.REJECTED),
        (TimedOut("x"), ReplyStatus.TIMEOUT),
        (LinkLost("x"), ReplyStatus.TIMEOUT),
        (Refused("x"), ReplyStatus.DENIED),
        (NotReady("x"), ReplyStatus.DENIED),
        (Fault("x"), ReplyStatus.DENIED),
    ],
)
def test_each_error_has_its_status(error, status):
    one, answers = receipt()
    one.fail(error)
    assert [answer.status for answer in answers] == [status]


@pytest.mark.parametrize("error", [Refused("", hint="later"), Fault(""), LinkLost()])
def test_an_error_without_a_text_is_answered_with_its_class(error):
    one, answers = receipt()
    one.fail(error)
    assert [answer.reason for answer in answers] == [type(error).__name__]


def test_a_watcher_that_comes_late_hears_everything():
    one, _ = receipt()
    one.done()
    seen = []
    one.watch(seen.append)
    assert [reply.done for reply in seen] == [True]


def test_a_watcher_that_fails_keeps_neither_the_answer_nor_the_next_watcher_back(caplog):
    answers, seen = [], []
    one = Receipt("land", answers.append)
    one.watch(lambda _: 1 / 0)
    one.watch(seen.append)
    one.done()
    assert [reply.ok for reply in answers] == [True]
    assert len(seen) == 1
    assert "could not be passed on" in caplog.text


def test_an_asker_who_cannot_be_reached_is_no_failure_of_the_robot():
    def gone(reply):
        raise ConnectionError("the asker is gone")

    one = Receipt("land", gone, waits=True)
    one.done()
    assert one.ended.done


@pytest.mark.parametrize("when", ["before", "between", "after"])
def test_a_repeat_gets_the_answers_of_the_first_whenever_it_comes(when):
    (first, heard), (repeat, answers) = receipt(waits=True), receipt(waits=True)
    if when == "before":
        repeat.follow(first)
    first.accept()
    if when == "between":
        repeat.follow(first)
    first.fail(Fault("a motor is hot"))
    if when == "after":
        repeat.follow(first)
    assert answers == heard
    assert len(answers) == 2


def test_a_ticket_that_has_ended_keeps_neither_its_asker_nor_its_watchers():
    class Listener:
        def hear(self, _reply):
            """Take an answer."""

    asker, watcher = Listener(), Listener()
    kept = [weakref.ref(asker), weakref.ref(watcher)]
    receipt = Receipt("poke", asker.hear, waits=True)
    receipt.watch(watcher.hear)
    receipt.accept()
    receipt.done()
    del asker, watcher
    assert [each() for each in kept] == [None, None]
    assert receipt.ended.done
