import contextlib
import socket
import subprocess
import threading

import pytest

from fleet.clock import SystemClock
from fleet.cloud.client import CloudClient
from fleet.cloud.values import CloudSettings, CloudState
from tests.tools.proxy import TcpProxy
from tests.tools.waiting import wait_until

WITHIN = 60.0  # s


class Watched:
    """A cloud client whose callbacks a test can wait for."""

    def __init__(self, loop, port, name="edge", subscriptions=None, spool=None, **settings):
        self.loop = loop
        self.states = []
        self.messages = []
        self.broken = False
        self._news = threading.Condition()
        chosen = {"host": "127.0.0.1", "port": port, "tls": False, "client_id": name} | settings
        self.client = CloudClient(
            CloudSettings(**chosen),
            subscriptions or {},
            on_message=self._on_message,
            on_read=lambda: None,
            on_state=lambda state, cause: self._note(self.states, (state, cause)),
            clock=SystemClock(),
            spool=spool,
        )

    def start(self):
        self.loop.call(self.client.start)
        return self

    def connected(self):
        """Start, and wait until messages can flow."""
        self.start().until(lambda: self.client.state is CloudState.CONNECTED)
        return self

    def until(self, reached):
        with self._news:
            assert self._news.wait_for(reached, WITHIN), (self.states, vars(self.client.stats))

    def reaches(self, state, words=""):
        """Wait until the client has told of a state with these words in its cause."""
        self.until(lambda: any(one is state and words in cause for one, cause in self.states))

    def publish(self, topic, payload=b"", **options):
        """Publish."""
        return self.client.publish(topic, payload, **options)

    def acked(self, count):
        """Wait until the broker has acknowledged so many messages."""
        wait_until(f"{count} are acknowledged", lambda: self.client.stats.acked >= count)
        assert self.client.stats.acked == count

    def payloads(self, count):
        """Wait for that many messages and return what they carry."""
        self.until(lambda: len(self.messages) >= count)
        return [message.payload for message in self.messages]

    def _note(self, where, what):
        with self._news:
            where.append(what)
            self._news.notify_all()

    def _on_message(self, messages):
        for message in messages:
            self._note(self.messages, message)
        if self.broken:
            raise RuntimeError("the one who takes messages is broken")


@pytest.fixture
def watched(background_loop):
    """Make cloud clients: ``watched(port, name, {filter: qos}, **settings)``; closed when the test ends."""
    made = []

    def make(port, *arguments, **settings):
        made.append(Watched(background_loop, port, *arguments, **settings))
        return made[-1]

    yield make
    for one in made:
        one.client.close(0.5)
        assert one.client.state is CloudState.CLOSED or not one.states


@pytest.fixture(params=["broker", "mosquitto"])
def any_broker(request):
    """Run each broker in turn, where everybody may come in."""
    return request.getfixturevalue(request.param)


@pytest.fixture
def listener():
    """Listen like a broker that says only what the test says: ``listener.accept()``."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(WITHIN)
        yield server


@pytest.fixture
def relay():
    """Stand between a client and a broker: ``relay(port)`` has ``port``, ``target`` and ``cut()``."""
    with contextlib.ExitStack() as made:
        yield lambda target: made.enter_context(TcpProxy(target))


@pytest.fixture
def certificate(tmp_path, program):
    """Make a certificate of its own authority for ``localhost``; return the paths of it and of its key."""
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    command = "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2"
    names = ("-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost", "-keyout", key, "-out")
    subprocess.run(
        [program("openssl"), *command.split(), *names, certificate], check=True, capture_output=True
    )
    return certificate, key


@pytest.fixture
def ends():
    """Return both ends of a TCP connection, ours first."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        ours = socket.create_connection(server.getsockname())
        theirs, _ = server.accept()
    ours.setblocking(False)
    theirs.settimeout(WITHIN)
    with ours, theirs:
        yield ours, theirs
