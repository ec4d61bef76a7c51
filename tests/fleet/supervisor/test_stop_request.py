"""An emergency stop through every supervisor: each is asked before any is waited for."""

import socket
import threading

import pytest

from fleet.supervisor import protocol, stop_request
from fleet.supervisor.protocol import LONGEST, LONGEST_REASON, OrderlyEnd, StopAnswer, StopRequest
from fleet.supervisor.sockets import listening, socket_of
from fleet.supervisor.stop_request import stop_all


class Supervisor:
    """A supervisor that answers a stop as the test says, once all of them were asked."""

    def __init__(self, folder, number, answer, others):
        self.path = socket_of(folder, number)
        self.asked = []
        self._answer, self._others = answer, others
        self._listener = listening(self.path)
        self._listener.setblocking(True)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        peer, _ = self._listener.accept()
        with peer:
            peer.settimeout(20)
            self.asked.append(protocol.decode(peer.recv(LONGEST)))
            self._others.wait(20)
            if self._answer is not None:
                peer.send(self._answer)

    def end(self):
        self._thread.join(30)
        self._listener.close()
        assert not self._thread.is_alive()


@pytest.fixture
def supervisors(short_folder):
    """Start a supervisor for each answer."""
    started = []

    def start(*answers):
        others = threading.Barrier(len(answers))
        for number, answer in enumerate(answers, 1):
            data = answer if isinstance(answer, bytes | None) else protocol.encode(answer)
            started.append(Supervisor(short_folder, number, data, others))
        return started

    yield start
    for each in started:
        each.end()


def test_every_supervisor_is_asked_before_any_is_waited_for(supervisors, short_folder):
    answers = [StopAnswer(0, "yard", ("rex",)), StopAnswer(0, "barn", kept=True)]
    started = supervisors(*answers)
    assert stop_all(short_folder, ("rex",), why="smoke", request="7f") == answers
    assert [each.asked for each in started] == [[StopRequest(("rex",), why="smoke", request="7f")]] * 2


@pytest.mark.parametrize("answer", [None, b"nonsense", OrderlyEnd()])
def test_one_that_does_not_answer_takes_nothing_from_the_others(supervisors, short_folder, answer):
    other = StopAnswer(0, "barn", ("ada",))
    supervisors(answer, other)
    assert stop_all(short_folder) == [other]


def test_one_that_hangs_is_not_waited_for_for_ever(short_folder, monkeypatch):
    monkeypatch.setattr(stop_request, "STOP_WITHIN", 0.05)
    with listening(socket_of(short_folder, 1)):
        assert stop_all(short_folder) == []


def test_the_socket_of_a_dead_one_is_removed_and_the_next_asked(supervisors, short_folder):
    path = socket_of(short_folder, 0)
    dead = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    dead.bind(str(path))
    dead.close()
    answer = StopAnswer(0, "yard", ("rex",))
    supervisors(answer)
    assert stop_all(short_folder) == [answer]
    assert not path.exists()


def test_a_file_that_is_no_socket_is_reported_and_stays(supervisors, short_folder, caplog):
    strange = socket_of(short_folder, 0)
    strange.symlink_to(strange)
    answer = StopAnswer(0, "yard", ("rex",))
    supervisors(answer)
    assert stop_all(short_folder) == [answer]
    assert f"the supervisor at {strange} cannot be reached: " in caplog.text
    assert strange.is_symlink()


def test_without_any_supervisor_nobody_answers(short_folder):
    assert stop_all(short_folder) == []
    assert stop_all(short_folder / "missing") == []


def asked(supervisors, folder, *given, **named):
    """Return what a supervisor is asked for a stop."""
    (each,) = supervisors(StopAnswer())
    stop_all(folder, *given, **named)
    return each.asked[0]


@pytest.mark.parametrize("letter", ["x", "\0", "\U0001f600"])
def test_reason_and_request_are_cut_to_what_fits(supervisors, short_folder, letter):
    stop = asked(supervisors, short_folder, ("rex",), why=letter * 9000, request=letter * 9000)
    assert stop == StopRequest(("rex",), why=letter * LONGEST_REASON, request=letter * LONGEST_REASON)


def test_names_that_are_no_text_are_sent_as_far_as_they_can_be(supervisors, short_folder):
    stop = asked(supervisors, short_folder, ("rex", "r\udce9x"), why="\udce9")
    assert stop == StopRequest(("rex", "r?x"), why="?")


@pytest.mark.parametrize(("count", "named"), [(3000, True), (10_000, False)])
def test_more_names_than_fit_a_message_are_a_stop_of_all(supervisors, short_folder, count, named):
    names = tuple(f"robot-{number}" for number in range(count))
    stop = asked(supervisors, short_folder, names, why="smoke", request="7f")
    assert stop == StopRequest(names if named else (), why="smoke", request="7f")
