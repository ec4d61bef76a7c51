"""A notice is posted within its time, or the error is raised; the address never stands in an error."""

import http.client
import io
import threading
import urllib.error
import urllib.request

import pytest

from fleet.host.edge import webhook
from fleet.host.edge.webhook import Webhook

URL = "https://example.com/hook?token=secret"


class Server:
    """What is at the other end: it answers, fails, or hangs until it is let go."""

    def __init__(self):
        self.requests = []
        self.error = None
        self.go = threading.Event()
        self.go.set()

    def open(self, request, timeout):
        self.requests.append((request, timeout))
        assert self.go.wait(20)
        if self.error is not None:
            raise self.error
        return io.BytesIO()


@pytest.fixture
def server(monkeypatch):
    server = Server()
    monkeypatch.setattr(webhook.urllib.request, "build_opener", lambda *_handlers: server)
    yield server
    server.go.set()


def failure(hook):
    with pytest.raises(OSError, match=r".*") as error:
        hook.send(b"{}", 5.0)
    assert "secret" not in str(error.value)
    return str(error.value)


def test_a_notice_is_posted_as_json(server):
    Webhook(URL).send(b'{"text": "stop"}', 5.0)
    ((request, timeout),) = server.requests
    assert (request.full_url, request.get_method(), request.data) == (URL, "POST", b'{"text": "stop"}')
    assert (request.get_header("Content-type"), timeout) == ("application/json", 5.0)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (urllib.error.HTTPError(URL, 503, f"no {URL}", {}, io.BytesIO()), "HTTP 503"),
        (urllib.error.HTTPError(URL, 302, "moved", {}, io.BytesIO()), "HTTP 302"),
        (urllib.error.URLError("name or service not known"), "name or service not known"),
        (ConnectionResetError("reset by peer"), "reset by peer"),
        (http.client.BadStatusLine(URL), "BadStatusLine"),
        (ValueError(f"what is {URL}"), "ValueError"),
    ],
)
def test_every_failure_is_raised_in_a_few_words_and_without_the_address(server, error, words):
    server.error = error
    assert failure(Webhook(URL)) == words


def test_a_server_that_hangs_is_not_waited_for_and_not_asked_again_meanwhile(server):
    server.go.clear()
    hook = Webhook(URL)
    with pytest.raises(TimeoutError, match=r"no answer within 0\.01 s"):
        hook.send(b"{}", 0.01)
    assert failure(hook) == "the last request has not ended yet"
    assert len(server.requests) == 1
    server.go.set()
    hook._last.join(20)
    hook.send(b"{}", 5.0)
    assert len(server.requests) == 2


def test_no_redirect_is_followed():
    (handler,) = [
        each for each in Webhook(URL)._opener.handlers if isinstance(each, urllib.request.HTTPRedirectHandler)
    ]
    request = urllib.request.Request(URL, b"{}")
    assert handler.redirect_request(request, None, 302, "moved", {}, "https://elsewhere.example") is None


def test_a_server_that_answers_in_its_time_is_waited_for(server, monkeypatch):
    class Thread(threading.Thread):
        def join(self, timeout=None):
            waits.append(timeout)
            server.go.set()
            super().join(20)

    waits = []
    server.go.clear()
    monkeypatch.setattr(webhook.threading, "Thread", Thread)
    Webhook(URL).send(b"{}", 5.0)
    assert waits == [5.0]
