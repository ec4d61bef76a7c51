import json
import queue
import threading

import msgspec
import pytest

from fleet.bus import keys
from fleet.bus.zenoh_session import ZenohSession
from fleet.host.requests.stop_cause import cause_noted, local_cause
from fleet.host.workers.remote_robot import AGAIN, SILENT_AFTER, RemoteRobot
from fleet.model.command import Reply, ReplyStatus, Transport
from fleet.model.state import RobotState
from fleet.robot_config import AdapterConfig
from tests.tools.waiting import DEADLINE, wait_until

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"
ANNA = local_cause("anna", "smoke", "r1")
LONELY = {"mode": "peer", "listen/endpoints": [], "scouting/multicast/enabled": False}
DONE = Reply("takeoff", ReplyStatus.ACCEPTED)


class Bench:
    """A robot in a worker, with the worker played by the test on the same session."""

    def __init__(self, clock):
        self.clock = clock
        self.bus_session = ZenohSession(LONELY)
        self.later = queue.Queue()
        self.stops = []
        self.causes = []
        self.reports = []
        self.bus_session.subscribe_noted(keys.stop("yard"), self._heard)
        self.robot = RemoteRobot(
            AdapterConfig(name="rex", twin=TWIN),
            adapter="toy",
            edge="yard",
            control=self.bus_session,
            clock=clock,
            soon=self.later.put,
            arrival=clock.monotonic,
            worker="w",
            publish=self.reports.append,
        )
        self.bus_session.subscribe(
            keys.state("yard", "rex"), lambda _key, payload: self.robot.state_arrived(payload)
        )

    def _heard(self, payload, note):
        self.causes.append(cause_noted(note))
        self.stops.append(json.loads(payload))

    def works(self, *answers):
        """Play a worker that gives these answers; returns what it is asked."""
        requested = []

        def work(question):
            requested.append(question)
            for answer in answers:
                question.reply(answer if isinstance(answer, bytes) else msgspec.json.encode(answer))
            question.close()

        self.bus_session.declare_queryable(keys.command("yard", "rex"), work)
        return requested

    def request(self, payload, kind="command", **fields):
        """Ask, and return the list of answers that the loop will fill."""
        answers = []
        payload = payload if isinstance(payload, bytes) else json.dumps(payload).encode()
        take = self.robot.read(kind, payload, transport=Transport.CLOUD, **fields)
        if take:
            take(answers.append)
        return answers

    def answered(self, answers):
        """Let the loop run once; return the one answer there is."""
        self.later.get(timeout=DEADLINE)()
        assert self.later.empty()
        (answer,) = answers
        return answer

    def stopped(self, times=1):
        """Wait for the stops that went out; returns whom each names."""
        wait_until(f"{times} stops", lambda: len(self.stops) >= times)
        return self.stops

    def says(self, **fields):
        state = RobotState("rex", TWIN, "toy", "yard", self.clock.time(), **fields)
        self.bus_session.put(keys.state("yard", "rex"), msgspec.json.encode(state))


@pytest.fixture
def bench(bench):
    """Reuse the controller's clock: it stands still until it is told to go on."""
    bench = Bench(bench.clock)
    yield bench
    bench.bus_session.close()


def test_a_message_goes_to_the_worker_as_it_is_and_its_answer_comes_back(bench):
    requested = bench.works(DONE)
    answers = bench.request(b'{"command": "takeoff"}', request_id="q1")
    assert bench.answered(answers) == DONE
    assert requested[0].payload == b'{"command": "takeoff"}'
    assert requested[0].parameters == {"kind": "command", "way": "cloud", "id": "q1"}


def test_only_the_first_answer_counts(bench):
    bench.works(DONE, Reply("takeoff", ReplyStatus.REJECTED, "changed my mind"))
    assert bench.answered(bench.request({"command": "takeoff"})) == DONE


@pytest.mark.parametrize(
    ("given", "heard"),
    [
        ([DONE], [None, False]),
        ([DONE, Reply("takeoff", ReplyStatus.ACCEPTED, done=True)], [None, True]),
        ([Reply("takeoff", ReplyStatus.ACCEPTED, done=True)], [True]),
        ([Reply("takeoff", ReplyStatus.DENIED, "no GPS")], [None]),
        ([], [None]),
    ],
)
def test_who_waits_hears_how_it_ended_also_from_a_worker_that_died_over_it(bench, given, heard):
    requested = bench.works(*given)
    bench.robot.set_worker_problem("killed by SIGKILL")
    answers = bench.request({"command": "takeoff"}, waits=True)
    for _ in heard:
        bench.later.get(timeout=DEADLINE)()
    assert [answer.done for answer in answers] == heard
    assert requested[0].parameters["wait"] == "1"
    if heard == [None, False]:
        assert answers[1].reason == "worker w did not say how it ended: killed by SIGKILL"


def test_a_worker_that_is_not_there_is_reported_with_the_cause(bench):
    bench.robot.set_worker_problem("worker w: ended with exit code 1")
    answer = bench.answered(bench.request({"command": "takeoff"}))
    assert (answer.command, answer.status) == ("takeoff", ReplyStatus.TIMEOUT)
    assert answer.reason == "worker w did not answer: worker w: ended with exit code 1"


def test_an_answer_that_cannot_be_read_is_none(bench, caplog):
    bench.works(b"garbage")
    assert bench.answered(bench.request({"command": "takeoff"})).status is ReplyStatus.TIMEOUT
    assert "a bus callback failed" in caplog.text


def test_navigation_without_a_worker_is_answered_in_its_name(bench):
    goal = {"command": "goto", "position": [1, 2, 3], "source_type": "tele"}
    assert bench.answered(bench.request(goal, kind="navigate")).command == "navigate"


def test_what_cannot_be_read_is_for_the_worker_to_refuse(bench):
    refusal = Reply("command", ReplyStatus.REJECTED, "not JSON")
    requested = bench.works(refusal)
    assert bench.answered(bench.request(b"{")) == refusal
    assert requested[0].payload == b"{"


def test_a_worker_that_is_back_is_stopped_again_before_it_is_logged(bench, blocked_log):
    bench.robot.stop_later(ANNA)
    with blocked_log("fleet.robot.rex"):
        thread = threading.Thread(target=bench.robot._came_or_went, args=("key", True), daemon=True)
        thread.start()
        wait_until("it is stopped while the log hangs", lambda: bench.stops == [["rex"]])
        assert thread.is_alive()
    thread.join(60)


def test_a_reply_on_its_way_back_asks_nothing(bench):
    requested = bench.works(DONE)
    assert bench.request({"status": "ok", "command": "takeoff"}) == []
    assert requested == []
    assert bench.later.empty()


@pytest.mark.parametrize(
    "message",
    [
        {"command": "emergency_stop"},
        {"command": "emergency_stop", "timestamp": "never", "source_type": 7},
        {"command": "estop", "data": {"activate": True}},
        {"type": "emergency_stop"},
    ],
)
def test_an_emergency_stop_goes_over_the_stop_lane_at_once(bench, message):
    bench.robot.read("command", json.dumps(message).encode(), transport=Transport.CLOUD)
    assert bench.stopped() == [["rex"]]


def test_a_bus_that_is_held_up_keeps_nobody_from_reading_the_stop_of_another(bench):
    free, held = threading.Event(), []
    bench.bus_session.subscribe(keys.stop("yard"), lambda _key, _payload: held.append(free.wait(DEADLINE)))
    bench.robot.read("command", b'{"command": "emergency_stop"}', transport=Transport.CLOUD)
    assert held == []
    assert bench.robot.state().emergency_stop
    free.set()
    wait_until("the stop has gone out", lambda: held == [True])
    assert bench.stops == [["rex"]]


def test_a_stop_that_the_bus_refuses_is_reported_and_the_worker_is_still_asked(bench, caplog, monkeypatch):
    def refuse(*_arguments, **_options):
        raise RuntimeError("the session is closed")

    bench.works(Reply("emergency_stop", ReplyStatus.ACCEPTED))
    monkeypatch.setattr(bench.bus_session, "put", refuse)
    assert bench.answered(bench.request({"command": "emergency_stop"})).ok
    wait_until("the log", lambda: "the emergency stop did not go out at once" in caplog.text)


@pytest.mark.parametrize(
    "message",
    [
        {"command": "release_emergency_stop"},
        {"command": "estop", "data": {"activate": False}},
        {"status": "ok", "command": "emergency_stop"},
        {"command": "say", "data": {"text": "emergency_stop"}},
        {"command": "stop"},
    ],
)
def test_what_only_speaks_of_a_stop_is_none(bench, message):
    bench.robot.read("command", json.dumps(message).encode(), transport=Transport.CLOUD)
    assert bench.stops == []


def test_bytes_that_are_no_message_and_name_no_stop_are_none(bench):
    bench.robot.read("command", b"\xff no emergency_stop {", transport=Transport.CLOUD)
    assert bench.stops == []


def test_a_stop_whose_message_is_refused_reaches_the_worker_as_it_should_be_written(bench):
    requested = bench.works(Reply("emergency_stop", ReplyStatus.ACCEPTED))
    answers = bench.request(b'{"command": "emergency_stop", "data": {')
    answer = bench.answered(answers)
    assert bench.stopped() == [["rex"]]
    assert json.loads(requested[0].payload) == {"command": "emergency_stop"}
    assert answer.ok
    assert answer.reason.startswith("taken for emergency_stop, though the message was refused: ")


def test_what_is_too_large_to_be_read_stays_here(bench):
    requested = bench.works(Reply("emergency_stop", ReplyStatus.ACCEPTED))
    bench.answered(bench.request(b"x", unread="2000000 bytes are more than are read"))
    (refused,) = bench.request(b"x", kind="motion", unread="2000000 bytes are more than are read")
    assert [question.payload for question in requested] == [b'{"command":"emergency_stop"}']
    assert (refused.status, refused.reason) == (ReplyStatus.REJECTED, "2000000 bytes are more than are read")
    assert bench.stopped() == [["rex"]]


def test_before_the_worker_speaks_the_robot_is_offline(bench):
    state = bench.robot.state()
    assert (state.health, state.cause, state.worker) == ("offline", "its worker is starting", "w")


def test_the_worker_s_word_counts_for_as_long_as_it_speaks(bench):
    bench.says(health="ok", mode="GUIDED")
    assert (bench.robot.state().health, bench.robot.state().mode) == ("ok", "GUIDED")
    bench.robot.set_worker_problem("")
    bench.clock.advance(SILENT_AFTER + 0.1)
    state = bench.robot.state()
    assert (state.health, state.cause) == ("offline", "its worker is silent")
    assert state.stamp == bench.clock.time()


def test_a_robot_whose_worker_died_is_reported_as_lost_once_by_the_edge(bench, caplog):
    bench.says(health="ok", reachable=True)
    wait_until("its state is heard", lambda: bench.robot.state().reachable)
    for _ in range(2):
        bench.robot.set_worker_problem("worker w: killed by SIGKILL")
    lost, gone = bench.reports
    assert (lost.kind, lost.text) == ("lost", "offline: worker w: killed by SIGKILL")
    assert (gone.type, gone.fields) == ("disconnected", {"reason": "worker w: killed by SIGKILL"})
    assert [record.name for record in caplog.records] == ["fleet.robot.rex"]


def test_the_age_of_what_is_shown_grows_while_the_worker_is_silent(bench):
    bench.says(health="ok", age=0.5, speed=1.0)
    bench.clock.advance(2.0)
    assert (bench.robot.state().age, bench.robot.state().speed) == (2.5, 1.0)
    bench.robot.set_worker_problem("worker w: hangs")
    bench.clock.advance(SILENT_AFTER)
    assert (bench.robot.state().age, bench.robot.state().speed) == (2.5 + SILENT_AFTER, None)


def test_a_worker_that_ended_takes_its_word_with_it(bench):
    bench.says(health="ok")
    bench.robot.set_worker_problem("worker w: hangs")
    assert (bench.robot.state().health, bench.robot.state().cause) == ("offline", "worker w: hangs")


@pytest.mark.parametrize("payload", [b"garbage", b"{}", b'{"name": 5}'])
def test_a_state_that_cannot_be_read_changes_nothing(bench, payload):
    bench.says(health="ok")
    bench.bus_session.put(keys.state("yard", "rex"), payload)
    assert bench.robot.state().health == "ok"


def test_a_health_that_nobody_knows_changes_nothing(bench, caplog):
    bench.says(health="ok")
    bench.says(health="splendid")
    assert bench.robot.state().health == "ok"
    assert "unknown health 'splendid'" in caplog.text


def test_whoever_asks_for_the_robot_hears_that_its_worker_is_gone(bench):
    bench.robot.set_worker_problem("worker w: ended with exit code 1")
    ((key, answer),) = bench.bus_session.request(keys.state("*", "*"), b"", timeout=60.0)
    state = msgspec.json.decode(answer, type=RobotState)
    assert (key, state.health) == (keys.state("yard", "rex"), "offline")
    assert state.cause == "worker w: ended with exit code 1"


def test_an_emergency_stop_outlives_its_worker(bench):
    bench.says(health="ok", emergency_stop=True)
    bench.robot.set_worker_problem("worker w: ended with exit code 1")
    bench.bus_session.token(keys.robot("yard", "rex"))
    assert bench.stopped() == [["rex"]]


def test_an_emergency_stop_that_the_worker_had_no_time_to_tell_outlives_it_too(bench):
    bench.says(health="ok")
    bench.robot.read("command", b'{"command": "emergency_stop"}', transport=Transport.CLOUD)
    bench.bus_session.token(keys.robot("yard", "rex"))
    assert bench.stopped(2) == [["rex"], ["rex"]]


def test_a_stop_that_a_worker_does_not_tell_of_is_put_again_while_it_speaks(bench):
    bench.robot.stop_later(ANNA)
    bench.says(health="ok")
    assert bench.stopped() == [["rex"]]
    assert bench.robot.state().emergency_stop
    wait_until("it has gone out", lambda: not bench.robot._putting_again.locked())
    bench.clock.advance(AGAIN)
    bench.says(health="ok")
    assert bench.stopped(2) == [["rex"], ["rex"]]
    assert [cause.request for cause in bench.causes] == ["r1", "r1"]


def test_a_stop_that_came_while_the_worker_was_frozen_is_set_in_the_next_one(bench):
    bench.robot.stop_later(ANNA)
    bench.bus_session.token(keys.robot("yard", "rex"))
    assert bench.stopped() == [["rex"]]
    assert bench.causes[0].sentence == "asked by anna (claimed, on this computer): smoke"


def test_a_stop_that_the_worker_has_reported_is_the_workers_to_release(bench):
    bench.robot.stop_later(ANNA)
    bench.says(health="ok", emergency_stop=True)
    bench.says(health="ok", emergency_stop=False)
    assert not bench.robot.state().emergency_stop
    assert bench.stops == []


def test_a_stop_is_renewed_by_the_workers_own_word(bench):
    bench.robot.stop_later(ANNA)
    bench.robot.renew_stop(ANNA)
    assert bench.stopped() == [["rex"]]
    bench.says(health="ok", emergency_stop=True)
    bench.clock.advance(AGAIN)
    bench.robot.renew_stop(ANNA)
    assert bench.stops == [["rex"]]


def test_a_stop_says_to_the_worker_who_asked_for_it(bench):
    message = {"command": "emergency_stop", "source_type": "tele", "session_id": "anna"}
    bench.robot.read("command", json.dumps(message).encode(), transport=Transport.CLOUD, request_id="q1")
    bench.stopped()
    (cause,) = bench.causes
    assert cause.sentence == "asked by anna (claimed, tele, over the cloud)"
    assert len(cause.request) == 32  # of the very message, as the worker reckons it


def test_a_stop_of_the_edges_own_says_to_the_worker_why(bench):
    bench.robot.emergency(local_cause("", "stop input button: no heartbeat for 1 s"))
    bench.stopped()
    assert [cause.sentence for cause in bench.causes] == ["stop input button: no heartbeat for 1 s"]


def test_what_was_released_stays_released(bench):
    bench.says(health="ok", emergency_stop=True)
    bench.says(health="ok", emergency_stop=False)
    bench.bus_session.token(keys.robot("yard", "rex"))
    assert bench.stops == []


@pytest.mark.parametrize(("command", "taken"), [("takeoff", False), ("stop", True)])
def test_what_waited_too_long_for_the_edges_loop_is_refused_here_but_a_stop(bench, command, taken):
    requested = bench.works(DONE)
    answers = []
    take = bench.robot.read("command", json.dumps({"command": command}).encode(), transport=Transport.BUS)
    bench.clock.advance(6.0)
    take(answers.append)
    if taken:
        bench.answered(answers)
    assert (len(requested), answers[0].ok) == (int(taken), taken)


@pytest.mark.parametrize("fields", [{"name": "max"}, {"twin": TWIN.replace("1", "2")}, {"edge": "barn"}])
def test_a_state_that_is_not_the_robots_own_is_refused(bench, caplog, fields):
    own = {"name": "rex", "twin": TWIN, "adapter": "toy", "edge": "yard", "stamp": 1.0, "health": "ok"}
    for _ in range(3):
        bench.robot.state_arrived(json.dumps(own | fields).encode())
    assert not bench.robot.state().reachable
    assert caplog.text.count("a state of rex that is not its own was refused") == 1
