"""Who is told of faults and stops without a cloud: in time, bounded, and never holding anybody up."""

import asyncio
import http.server
import json
import socket
import sys
import threading
import time

import pytest
from pydantic import ValidationError

from fleet.config.notify import NotifyConfig, with_members
from fleet.host.edge import notifier
from fleet.host.edge.notifier import NoticeTarget, Notifier, run_program
from fleet.host.edge.webhook import Webhook
from fleet.model.event import EventKind, EventReport, Severity
from fleet.testing.clock import ManualClock
from tests.tools.waiting import DEADLINE, wait_until

STOP = EventReport(1000.0, EventKind.STOP, "stop asked", Severity.WARNING)


class Hook:
    """A webhook on loopback that keeps what it is told and answers as the test says."""

    def __init__(self, status=200, headers=()):
        hook = self
        self.got = []

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self):
                hook.got.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
                self.send_response(status)
                for name, value in headers:
                    self.send_header(name, value)
                self.end_headers()

            def log_message(self, *_):
                pass

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}/hook?key=s3cr3t"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self):
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture
def hook():
    hook = Hook()
    yield hook
    hook.close()


@pytest.fixture
def target():
    """Make a target that sends with what the test gives; end them all."""
    made = []

    def target(send, clock=None, **config):
        config = NotifyConfig(command=("true",), **config)
        made.append(NoticeTarget(config, "yard-1", clock or ManualClock(), send))
        return made[-1]

    yield target
    for each in made:
        each.end()
        each.join()


def test_a_stop_reaches_a_webhook_as_json(hook):
    notifier = Notifier([NotifyConfig(url=hook.url)], "yard-1", ManualClock())
    notifier.handle("rex", STOP)
    notifier.close()
    (got,) = hook.got
    assert (got["edge"], got["robot"], got["kind"], got["text"]) == ("yard-1", "rex", "stop", "stop asked")
    assert got["time"] == "1970-01-01T00:16:40.000+00:00"


def test_other_targets_are_notified_from_then_on_and_those_that_stay_go_on(hook):
    other = Hook()
    first, second = NotifyConfig(url=hook.url), NotifyConfig(url=other.url)
    notifier = Notifier([first], "yard-1", ManualClock())
    notifier.handle("rex", STOP)
    notifier.use([NotifyConfig(url=hook.url), second])
    (kept, added) = notifier._targets
    notifier.handle("max", STOP)
    notifier.use([second])
    assert notifier._targets == [added]
    kept.join()
    notifier.handle("ada", STOP)
    notifier.close()
    other.close()
    assert [got["robot"] for got in hook.got] == ["rex", "max"], "what waits is sent"
    assert [got["robot"] for got in other.got] == ["max", "ada"]


def test_a_program_gets_it_on_its_stdin(tmp_path):
    script = f"import sys; open({str(tmp_path / 'got')!r}, 'wb').write(sys.stdin.buffer.read())"
    notifier = Notifier(
        [NotifyConfig(command=(sys.executable, "-c", script), timeout=30)], "yard-1", ManualClock()
    )
    notifier.handle("rex", STOP)
    wait_until("it ran", lambda: (tmp_path / "got").exists() and (tmp_path / "got").read_bytes())
    assert json.loads((tmp_path / "got").read_bytes())["message"] == "rex: stop asked"
    notifier.close()


def test_what_is_heard_on_the_bus_takes_no_room_from_our_own_robots(target):
    going, sent = threading.Event(), []
    made = target(lambda body, _within: (going.wait(DEADLINE), sent.append(body)), per_minute=60)
    for _ in range(200):
        made.enqueue("forged", STOP, heard=True)
    made.enqueue("rex", STOP)
    going.set()
    wait_until("our own is told", lambda: json.loads(sent[-1])["robot"] == "rex" if sent else False)


@pytest.mark.parametrize(
    ("kind", "severity", "expected"),
    [
        (EventKind.STOP, Severity.WARNING, True),
        (EventKind.EMERGENCY_STOP, Severity.CRITICAL, True),
        (EventKind.HEALTH, Severity.ERROR, True),
        (EventKind.HEALTH, Severity.WARNING, False),
        (EventKind.COMMAND, Severity.INFO, False),
        (EventKind.OUTCOME, Severity.WARNING, False),
        (EventKind.LOST, Severity.WARNING, True),
    ],
)
def test_faults_and_stops_are_reported_and_not_every_command(target, kind, severity, expected):
    sent = []
    made = target(lambda body, _within: sent.append(body))
    made.enqueue("rex", EventReport(0.0, kind, "x", severity))
    made.end()
    made.join()
    assert bool(sent) == expected


def test_robots_narrow_it_down(target):
    sent = []
    made = target(lambda body, _within: sent.append(json.loads(body)["robot"]), robots=("rex",))
    for robot in ("max", "rex"):
        made.enqueue(robot, STOP)
    wait_until("it is sent", lambda: sent)
    made.end()
    made.join()
    assert sent == ["rex"]


def test_a_target_that_fails_is_tried_three_times_and_reported_once_without_its_address(
    target, monkeypatch, caplog
):
    monkeypatch.setattr(notifier, "WAITS", (0.001, 0.001))
    tries = []

    def fails(_body, _within):
        tries.append(1)
        raise OSError("nobody there")

    made = target(fails)
    made.enqueue("rex", STOP)
    made.enqueue("rex", STOP)
    wait_until("it is given up", lambda: len(tries) == 6)
    made.end()
    made.join()
    assert caplog.text.count("did not get to its") == 1


def test_more_than_wanted_in_a_minute_is_counted_and_the_number_reported(target):
    sent, clock = [], ManualClock()
    made = target(lambda body, _within: sent.append(json.loads(body)), clock, per_minute=3)
    for _ in range(50):
        made.enqueue("rex", STOP)
    clock.advance(61)
    wait_until("the first are sent", lambda: len(sent) == 3)
    made.enqueue("rex", STOP)
    wait_until("the next is sent", lambda: len(sent) == 4)
    assert sum(each.get("left_out", 0) for each in sent) == 47


def test_a_target_that_hangs_holds_nobody_up(target):
    free = threading.Event()
    made = target(lambda _body, _within: free.wait(20), per_minute=600)
    began = time.monotonic()
    for _ in range(1000):
        made.enqueue("rex", STOP)
    assert time.monotonic() - began < 15.0, "the target hangs for 20 s"
    assert len(made._waiting) <= notifier.WAITING
    free.set()


def test_a_server_that_drips_is_left_in_time():
    with socket.create_server(("127.0.0.1", 0)) as server:
        ended = threading.Event()

        def drip():
            connection, _ = server.accept()
            with connection:
                connection.sendall(b"HTTP/1.1 200 OK\r\n")
                while not ended.wait(0.05):
                    try:
                        connection.sendall(b"X: y\r\n")
                    except OSError:
                        return

        thread = threading.Thread(target=drip, daemon=True)
        thread.start()
        with pytest.raises(TimeoutError):
            Webhook(f"http://127.0.0.1:{server.getsockname()[1]}/").send(b"{}", 0.3)
        ended.set()
        thread.join(5)


@pytest.mark.parametrize(("status", "headers"), [(500, ()), (302, (("Location", "http://127.0.0.1:1/"),))])
def test_an_answer_that_is_no_success_is_a_failure_and_no_redirect_is_followed(status, headers):
    hook = Hook(status, headers)
    with pytest.raises(OSError, match=f"HTTP {status}") as failure:
        Webhook(hook.url).send(b"{}", 5.0)
    assert "s3cr3t" not in str(failure.value)
    hook.close()


def test_a_program_that_does_not_end_is_ended_with_its_children():
    with pytest.raises(TimeoutError):
        run_program(["sh", "-c", "sleep 60 & sleep 60"], b"{}", 0.2)
    with pytest.raises(OSError, match="exit code 3"):
        run_program(["sh", "-c", "exit 3"], b"{}", 20.0)


@pytest.mark.parametrize("given", [{}, {"url": "ftp://x"}, {"url": "http://x", "command": ("true",)}])
def test_a_target_is_one_thing(given):
    with pytest.raises(ValidationError):
        NotifyConfig(**given)


def test_the_address_is_a_secret(hook):
    assert "s3cr3t" not in repr(NotifyConfig(url=hook.url))


@pytest.mark.parametrize("where", [{"worker": "main"}, {}])
async def test_a_stop_is_reported_without_a_cloud_also_of_a_robot_in_a_worker(
    yard, run_edge, requests, hook, where
):
    place = yard(rex=where)
    place.change(notify=[{"url": hook.url}])
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        bus_session = await asyncio.to_thread(place.bus_session)
        await asyncio.to_thread(lambda: list(bus_session.request(f"fleet/{place.id}/stop", b"", timeout=60)))
        await requests.until(lambda: [got for got in hook.got if got["kind"] == "stop"])
        await asyncio.to_thread(bus_session.close)
    assert {got["robot"] for got in hook.got} == {"rex"}


def test_a_group_stands_for_its_robots():
    configs = [NotifyConfig(command=("x",), robots=("yard", "kestrel")), NotifyConfig(command=("x",))]
    first, second = with_members(configs, {"yard": ("beast", "rover")})
    assert (first.robots, second.robots) == (("beast", "rover", "kestrel"), ())
