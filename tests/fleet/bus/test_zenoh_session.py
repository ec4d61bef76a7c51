import queue
import threading
from functools import partial

import pytest

from fleet.bus.bus import join, join_control
from fleet.bus.settings import BusSettings
from fleet.bus.zenoh_session import AT_ONCE, ZenohSession
from fleet.errors import BusError
from tests.tools.waiting import DEADLINE, wait_until


@pytest.fixture
def caller(directory, opened, edge):
    """Join with the edge's control session."""
    return opened(join_control(BusSettings("yard"), directory))


def test_what_is_published_arrives_with_key_and_payload(edge, caller):
    heard = queue.Queue()
    edge.control.subscribe("fleet/*/stop", lambda *sample: heard.put(sample))
    caller.put("fleet/yard/stop", b"now", urgent=True)
    assert heard.get(timeout=DEADLINE) == ("fleet/yard/stop", b"now")


def took(got, *sample):
    got.put(sample)


def test_one_subscription_for_many_keys_calls_only_what_belongs_to_the_very_key(edge, caller):
    got = queue.Queue()
    edge.control.subscribe_many("t/*", {key: partial(took, got, key) for key in ("t/a", "t/b")})
    for key in ("t/stranger", "t/*", "t/b"):
        caller.put(key, b"to " + key.encode())
    assert got.get(timeout=DEADLINE) == ("t/b", b"to t/b")
    caller.put("t/a", b"1")
    assert got.get(timeout=DEADLINE) == ("t/a", b"1")


def test_publishers_know_which_of_their_keys_somebody_else_listens_to(edge, caller):
    states = edge.control.publishers("fleet/yard/robots/*/state")
    edge.control.subscribe("fleet/yard/**", lambda *_: None)  # our own session is nobody else
    heard = queue.Queue()
    assert states.wanted("fleet/yard/robots/rex/state") is None
    caller.subscribe("fleet/yard/robots/rex/state", lambda *sample: heard.put(sample))
    rex = wait_until("it is wanted", lambda: states.wanted("fleet/yard/robots/rex/state"))
    rex.put(b"well")
    assert heard.get(timeout=DEADLINE) == ("fleet/yard/robots/rex/state", b"well")
    # The first samples of a new key go in any case: who listens is told a moment later.
    assert states.wanted("fleet/yard/robots/max/state") is not None
    wait_until("nobody wants it", lambda: states.wanted("fleet/yard/robots/max/state") is None)
    caller.close()
    wait_until("it is not wanted any more", lambda: not states.wanted("fleet/yard/robots/rex/state"))


def test_a_callback_that_raises_is_logged_and_stops_nobody(edge, caplog):
    heard = []

    def fail(_key, payload):
        raise RuntimeError("oops")

    edge.control.subscribe("a/b", fail)
    edge.control.subscribe("a/*", lambda _key, payload: heard.append(payload))
    edge.control.put("a/b", b"1")
    edge.control.put("a/b", b"2")
    assert heard == [b"1", b"2"]
    assert caplog.text.count("a bus callback failed") == 2


def test_what_others_publish_is_gathered_in_order_and_what_we_say_is_not(directory, opened, edge):
    other = opened(join(BusSettings("yard"), directory)).reports
    heard = []
    edge.reports.subscribe_batches("a/*", heard.extend)
    edge.reports.put("a/own", b"")
    wait_until("it is heard", lambda: other.put("a/0", b"first") or heard)
    for number in range(3 * AT_ONCE):
        other.put(f"a/{number % 3}", b"%d" % number, urgent=True)
    wait_until("all is heard", lambda: ("a/2", b"%d" % (3 * AT_ONCE - 1)) in heard)
    numbers = [int(payload) for _, payload in heard if payload != b"first"]
    assert numbers == list(range(3 * AT_ONCE))
    assert "a/own" not in dict(heard)


def test_a_gatherer_that_raises_goes_on_and_ends_with_its_lane(directory, opened, edge, caplog):
    heard, threads = [], []

    def fail(samples):
        heard.extend(samples)
        threads.append(threading.current_thread())
        raise RuntimeError("oops")

    other = opened(join(BusSettings("yard"), directory))
    other.reports.subscribe_batches("a/*", fail)
    wait_until("it is heard twice", lambda: edge.reports.put("a/b", b"") or len(heard) > 1)
    other.close()
    assert not threads[0].is_alive()
    assert caplog.text.count("a bus callback failed") > 1


def test_a_gatherer_that_is_ended_hears_nothing_more_and_wants_nothing(directory, opened, edge):
    other, heard, threads = opened(join(BusSettings("yard"), directory)), [], []

    def hear(samples):
        heard.extend(samples)
        threads.append(threading.current_thread())

    end = other.reports.subscribe_batches("a/*", hear)
    publisher = edge.reports.publisher("a/b")
    wait_until("it is heard", lambda: edge.reports.put("a/b", b"") or heard)
    end()
    assert not threads[0].is_alive()
    wait_until("it is wanted no more", lambda: not publisher.wanted)
    end()


def test_a_question_gets_the_answers_of_everybody(directory, opened, edge, caller):
    other = opened(join_control(BusSettings("yard"), directory))
    for bus_session, name in ((edge.control, b"edge"), (other, b"worker")):
        bus_session.declare_queryable(
            "fleet/yard/stop", lambda question, name=name: (question.reply(name), question.close())
        )
    answers = wait_until(
        "both answer",
        lambda: len(found := list(caller.request("fleet/*/stop", b"", timeout=5.0))) == 2 and found,
    )
    assert sorted(answers) == [("fleet/yard/stop", b"edge"), ("fleet/yard/stop", b"worker")]


def test_a_question_may_be_answered_more_than_once_and_later(edge, caller):
    requested = queue.Queue()
    edge.control.declare_queryable("fleet/yard/robots/rex/command", requested.put)
    answers = caller.request(
        "fleet/yard/robots/rex/command", b"go", timeout=DEADLINE, parameters={"wait": "1"}
    )
    question = requested.get(timeout=DEADLINE)
    assert (question.payload, question.parameters) == (b"go", {"wait": "1"})
    question.reply(b"receipt")
    assert next(answers)[1] == b"receipt"
    question.reply(b"end")
    question.close()
    assert [payload for _, payload in answers] == [b"end"]


def test_a_question_is_out_before_its_answers_are_read(edge, caller):
    requested = queue.Queue()
    edge.control.declare_queryable("a", requested.put)
    answers = caller.request("a", b"", timeout=DEADLINE)
    requested.get(timeout=DEADLINE).close()
    assert list(answers) == []


def test_nobody_answers_when_nobody_is_there(caller):
    assert list(caller.request("fleet/nobody/health", b"", timeout=DEADLINE)) == []


def test_a_question_that_is_never_answered_ends_with_its_time(edge, caller):
    kept = []
    edge.control.declare_queryable("a", kept.append)
    assert list(caller.request("a", b"", timeout=0.2)) == []
    assert len(kept) == 1


def test_an_answer_to_an_asker_who_left_harms_nobody(directory, edge):
    requested, gone = queue.Queue(), threading.Event()
    edge.control.declare_queryable("a", requested.put)
    asker = join_control(BusSettings("yard"), directory)
    asker.token("asker")
    edge.control.watch_tokens("asker", lambda _key, alive: alive or gone.set())
    asker.request_later("a", b"", timeout=DEADLINE, on_answer=lambda _: None, on_end=lambda: None)
    question = requested.get(timeout=DEADLINE)
    asker.close()
    assert gone.wait(DEADLINE)
    question.reply(b"late")
    question.close()
    question.reply(b"after the end")


def test_asking_later_tells_every_answer_and_the_end(edge, caller):
    answers = queue.Queue()
    edge.control.declare_queryable(
        "a", lambda question: (question.reply(b"1"), question.reply(b"2"), question.close())
    )
    caller.request_later("a", b"", timeout=DEADLINE, on_answer=answers.put, on_end=lambda: answers.put("end"))
    assert [answers.get(timeout=DEADLINE) for _ in range(3)] == [b"1", b"2", "end"]


def test_an_answer_that_cannot_be_taken_does_not_keep_the_end_away(edge, caller, caplog):
    ended = threading.Event()

    def fail(_payload):
        raise ValueError("no such reply")

    edge.control.declare_queryable("a", lambda question: (question.reply(b"?"), question.close()))
    caller.request_later("a", b"", timeout=DEADLINE, on_answer=fail, on_end=ended.set)
    assert ended.wait(DEADLINE)
    assert "no such reply" in caplog.text


def test_who_is_there_is_known_at_once_and_who_left_too(edge, caller):
    seen = queue.Queue()
    edge.control.token("fleet/yard")
    caller.watch_tokens("fleet/**", lambda *change: seen.put(change))
    assert seen.get(timeout=DEADLINE) == ("fleet/yard", True)
    take_back = edge.control.token("fleet/yard/robots/rex")
    assert seen.get(timeout=DEADLINE) == ("fleet/yard/robots/rex", True)
    take_back()
    take_back()
    assert seen.get(timeout=DEADLINE) == ("fleet/yard/robots/rex", False)


def test_the_token_of_a_killed_process_vanishes(directory, opened, spawn_edge):
    hub = opened(ZenohSession({"mode": "peer", "listen/endpoints": [f"unixsock-stream/{directory}/hub"]}))
    seen = queue.Queue()
    hub.watch_tokens("fleet/*", lambda *change: seen.put(change))
    process = spawn_edge(connect=[f"unixsock-stream/{directory}/hub"])
    assert seen.get(timeout=DEADLINE) == ("fleet/yard", True)
    process.kill()
    assert seen.get(timeout=DEADLINE) == ("fleet/yard", False)


def test_a_setting_that_zenoh_does_not_take_is_named_in_one_line():
    with pytest.raises(BusError, match=r"^the bus cannot be opened: listen/endpoints cannot be \[''\]$"):
        ZenohSession({"listen/endpoints": [""]})


@pytest.mark.parametrize(
    "endpoint", ["tcp/nonsense", "foo/127.0.0.1:1", "tcp/203.0.113.9:7447", "tls/127.0.0.1:0"]
)
def test_an_endpoint_that_cannot_be_opened_is_reported_in_one_line(endpoint):
    with pytest.raises(BusError, match=r"^the bus cannot be opened: [^\n]+$"):
        ZenohSession({"listen/endpoints": [endpoint]})


def test_a_worker_reaches_both_lanes(directory, opened, edge):
    worker = opened(join(BusSettings("yard"), directory))
    heard = queue.Queue()
    edge.reports.subscribe("cw/**", lambda *sample: heard.put(sample))
    edge.control.declare_queryable(
        "fleet/yard/health", lambda question: (question.reply(b"ok"), question.close())
    )
    wait_until("the report crosses", lambda: worker.reports.put("cw/x/data/y", b"1") or not heard.empty())
    assert heard.get() == ("cw/x/data/y", b"1")
    answers = wait_until(
        "it answers", lambda: list(worker.control.request("fleet/yard/health", b"", timeout=5.0))
    )
    assert answers == [("fleet/yard/health", b"ok")]
