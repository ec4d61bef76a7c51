"""A console that serves, with edges that are played."""

import asyncio
import contextlib
import http.client
import json
import shutil
import socket
import tempfile
from pathlib import Path

import pytest
from websockets.sync.client import connect

from fleet.console.login_links import LinkRequest, request_link
from fleet.console.program import serve
from fleet.console.task import ConsoleTask, link_socket
from fleet.model.permission import Permission
from fleet.runtime.event_loop import BackgroundLoop
from tests.tools.waiting import DEADLINE, wait_until


@pytest.fixture(scope="module")
def runtime():
    """Make a folder for the sockets of edges and consoles, and let all look there."""
    path = Path(tempfile.mkdtemp(prefix="fc"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FLEET_RUNTIME_DIR", str(path))
        yield path
    shutil.rmtree(path)


class Page:
    """One page of a browser without the browser: its WebSocket, and what it was told."""

    def __init__(self, socket):
        self.socket = socket
        self.answers = []
        self.entries = {}

    def request(self, kind, /, **fields):
        """Ask for something."""
        self.socket.send(json.dumps({"ask": kind, **fields}))

    def _take(self):
        message = json.loads(self.socket.recv(timeout=DEADLINE))
        if message["type"] == "answer":
            self.answers.append(message)
        for kind, entries in message.items():
            if isinstance(entries, dict):
                self.entries.setdefault(kind, {}).update(entries)
        return message

    def wait_for(self, kind, name, holds=bool):
        """Read until an entry is so."""
        while not (name in self.entries.get(kind, {}) and holds(self.entries[kind][name])):
            self._take()
        return self.entries[kind][name]

    def answer(self, request, *, final=False):
        """Read until a request is answered."""
        while True:
            for message in self.answers:
                if message["request"] == request and (not final or message.get("final")):
                    return message
            self._take()

    def next(self, kind):
        """Read the next message of a type."""
        while (message := self._take())["type"] != kind:
            pass
        return message


class Console:
    """A console on a thread of its own, and the ways to it."""

    def __init__(self, runtime, name="test", port=0, **task):
        self._loop = BackgroundLoop(f"console:{name}")
        self._runtime, self._task = runtime, ConsoleTask(name, port, **task)
        self._stack = contextlib.ExitStack()
        self._cookies = {}
        self.proofs = {}

    def __enter__(self):
        self._stack.enter_context(self._loop)
        self._ended = self._loop.call(asyncio.Event)

        async def begin():
            return asyncio.create_task(serve(self._task, self._runtime, self._ended))

        self._serving = self._loop.complete(begin())
        link = wait_until("the console", self.link)
        self.base = link.partition("/#")[0]
        self.port = int(self.base.rpartition(":")[2])
        return self

    def __exit__(self, *_):
        async def end():
            self._ended.set()
            await self._serving

        self._loop.complete(end())
        self._stack.close()

    def link(self, permission=Permission.ADMIN, operator="anna"):
        """Ask for a new link."""
        given = request_link(link_socket(self._runtime, self._task.name), LinkRequest(operator, permission))
        return given.link if given else None

    def token(self, permission=Permission.ADMIN):
        """Ask for the token of a new link."""
        return self.link(permission).partition("token=")[2]

    def request(self, method, path, *, body=None, **headers):
        """Send a request; returns status, headers and body. A cookie comes with its proof, if it has one."""
        headers.setdefault("x_fleet_proof", self.proofs.get(headers.get("cookie")))
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=DEADLINE)
        with contextlib.closing(connection):
            connection.putrequest(method, path, skip_host="host" in headers, skip_accept_encoding=True)
            for name, value in headers.items():
                if value is not None:
                    connection.putheader(name.replace("_", "-"), value)
            connection.endheaders(body)
            answer = connection.getresponse()
            try:
                content = answer.read()
            except ConnectionResetError:  # it refused the head, and closed without reading the body
                content = b""
            return answer.status, answer.headers, content

    def post(self, path, content, **headers):
        """Send JSON as a page of the console does."""
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        usual = {"origin": self.base, "content_type": "application/json", "content_length": str(len(body))}
        return self.request("POST", path, body=body, **(usual | headers))

    def cookie(self, permission=Permission.ADMIN):
        """Return the cookie of a session; the same for each permission."""
        if permission not in self._cookies:
            status, headers, body = self.post("/api/session", {"token": self.token(permission)})
            assert status == 200
            cookie = self._cookies[permission] = headers["set-cookie"].partition(";")[0]
            self.proofs[cookie] = json.loads(body)["proof"]
        return self._cookies[permission]

    @contextlib.contextmanager
    def page(self, permission=Permission.ADMIN):
        """Open a page."""
        cookie = self.cookie(permission)
        with connect(
            f"ws://127.0.0.1:{self.port}/ws",
            origin=self.base,
            additional_headers={"Cookie": cookie},
            subprotocols=["fleet.console", self.proofs[cookie]],
        ) as opened:
            yield Page(opened)

    def raw(self, text):
        """Send a request as it is; return the first line of the answer, empty without one."""
        with (
            contextlib.suppress(OSError),
            socket.create_connection(("127.0.0.1", self.port), timeout=DEADLINE) as sock,
        ):
            sock.sendall(text.encode())
            sock.shutdown(socket.SHUT_WR)
            with sock.makefile("rb") as answer:
                return answer.readline().decode()
        return ""


@pytest.fixture(scope="module")
def console(runtime):
    """Serve a console for the tests of a module."""
    with Console(runtime) as served:
        yield served


@pytest.fixture(scope="module")
def play_edge(runtime, module_at):
    """Play an edge, as many as needed."""
    played_edge = module_at("fleet/cli/conftest.py").PlayedEdge
    with contextlib.ExitStack() as stack:

        def play_edge(edge, *, robots=None, groups=None, **settings):
            played = played_edge(runtime, edge, robots or {}, groups or {}, settings)
            stack.callback(played.bus.close)
            return played

        yield play_edge


@pytest.fixture(scope="module")
def browser(program, module_at):
    """Run one browser for all tests of a module, which are plain functions: its loop runs on this thread."""
    with module_at("browser.py").open_page(program("chromium")) as page:
        yield page.context.browser


@pytest.fixture
def new_page(browser, module_at):
    """Open an empty page that remembers nothing; its errors, with ``console`` those told there too, fail."""
    with contextlib.ExitStack() as stack:
        pages = []

        def new_page(*, console=False, **options):
            context = browser.new_context(**options)
            stack.callback(context.close)
            page = context.new_page()
            page.set_default_timeout(60_000)  # busy computers are slow
            pages.append(module_at("browser.py").errors_of(page, console=console))
            return page

        yield new_page
        assert [error for errors in pages for error in errors] == []


@pytest.fixture(scope="session")
def serve_console():
    """Serve a console of one's own."""
    return Console
