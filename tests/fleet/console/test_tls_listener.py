"""The port with TLS: who speaks it is handed on, who does not is told so, and nobody holds up others."""

import asyncio
import contextlib
import ssl
from datetime import UTC, datetime, timedelta

import pytest

from fleet.config.certificates import Identity, issue_pair, make_authority
from fleet.console import tls_listener
from fleet.console.login_links import ConsoleError
from fleet.console.tls_listener import TlsListener, listen, tls_context
from tests.tools.waiting import DEADLINE

ADDRESS = "https://console.test:8443/"


@pytest.fixture
def files(tmp_path):
    """Write a certificate and its key."""
    now = datetime.now(UTC)
    authority = make_authority("site", now)
    identity = Identity("web", "console", ("127.0.0.1",), now + timedelta(days=1))
    pair, other = issue_pair(authority, identity, now), issue_pair(authority, identity, now)
    written = {
        "ca.pem": authority.certificate,
        "web.pem": pair.certificate,
        "web.key": pair.key,
        "other.key": other.key,
    }
    for name, content in written.items():
        (tmp_path / name).write_bytes(content)
    return tmp_path


class Greeting(asyncio.Protocol):
    """Answers each connection that is through its handshake."""

    def connection_made(self, transport):
        transport.write(b"hello\n")
        transport.close()


class Waiting(asyncio.Protocol):
    """Waits for a request."""


@contextlib.asynccontextmanager
async def listening(files, make=Greeting, is_unused=lambda _protocol: False):
    """Listen on a port."""
    listener = listen("127.0.0.1", 0)
    context = tls_context(str(files / "web.pem"), str(files / "web.key"))
    running = asyncio.create_task(TlsListener(listener, context, make, is_unused, ADDRESS).run())
    yield listener.getsockname()[1]
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    listener.close()


@pytest.fixture
async def port(files):
    """Listen, and return the port."""
    async with listening(files) as port:
        yield port


async def read_all(port, sent=b"", **options):
    async with asyncio.timeout(DEADLINE):
        reader, writer = await asyncio.open_connection("127.0.0.1", port, **options)
        writer.write(sent)
        answer = await reader.read()
        writer.close()
    return answer


def trusting(files):
    return ssl.create_default_context(cafile=str(files / "ca.pem"))


async def test_who_speaks_tls_is_handed_on(port, files):
    assert await read_all(port, ssl=trusting(files)) == b"hello\n"


@pytest.mark.parametrize("sent", [b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n", b"\0", b"SSH-2.0-x\r\n"])
async def test_who_speaks_something_else_learns_where_to_go_and_gets_nothing_else(port, sent):
    head, _, body = (await read_all(port, sent)).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 400 Bad Request\r\n")
    assert body == f"this port is for https; open {ADDRESS}\n".encode()


@pytest.mark.filterwarnings("ignore:ssl.TLSVersion:DeprecationWarning")
async def test_an_old_version_of_tls_is_refused(port, files):
    old = trusting(files)
    old.set_ciphers("DEFAULT:@SECLEVEL=0")  # else this side refuses it
    old.minimum_version = old.maximum_version = ssl.TLSVersion.TLSv1_1
    with pytest.raises((ssl.SSLError, ConnectionError)):
        await read_all(port, ssl=old)


async def test_who_says_nothing_or_breaks_off_keeps_nobody_else_out(port, files):
    async with contextlib.AsyncExitStack() as stack:
        for sent in (b"", b"\x16\x03\x01", b"\x16garbage", b"G") * 5:
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            stack.callback(writer.close)
            writer.write(sent)
        assert await read_all(port, ssl=trusting(files)) == b"hello\n"


async def test_a_connection_that_brings_no_request_is_ended_and_one_that_does_is_not(files, monkeypatch):
    monkeypatch.setattr(tls_listener, "FIRST_REQUEST", 0.05)
    async with listening(files, Waiting, lambda _protocol: True) as port:
        with contextlib.suppress(ConnectionError):
            assert await read_all(port, ssl=trusting(files)) == b""
    looked_at = asyncio.Event()
    async with listening(files, Waiting, lambda _protocol: looked_at.set()) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port, ssl=trusting(files))
        async with asyncio.timeout(DEADLINE):
            await looked_at.wait()
        assert not reader.at_eof()
        writer.close()


@pytest.mark.parametrize(
    ("cert", "key"), [("web.pem", "other.key"), ("none.pem", "web.key"), ("web.key", "web.key")]
)
def test_a_certificate_that_does_not_fit_is_reported(files, cert, key):
    with pytest.raises(ConsoleError, match=r"console\.tls cannot be used"):
        tls_context(str(files / cert), str(files / key))
