"""The console as a process: its port, its child's life, its end."""

import asyncio
import socket

import pytest

from fleet.console.login_links import ConsoleError, LinkRequest
from fleet.console.program import serve
from fleet.console.task import ConsoleTask
from fleet.model.permission import Permission

REQUESTED = LinkRequest("anna", Permission.ADMIN)


@pytest.fixture
def taken():
    with socket.create_server(("127.0.0.1", 0)) as other:
        yield other.getsockname()[1]


async def test_a_port_that_is_taken_is_reported(runtime, taken):
    with pytest.raises(ConsoleError, match=f"port {taken} on 127.0.0.1 cannot be opened: Address already"):
        await serve(ConsoleTask("taken", taken), runtime, asyncio.Event())


def test_another_port_is_taken_where_that_is_wanted(runtime, serve_console, taken):
    with serve_console(runtime, "free", port=taken, any_port=True) as served:
        assert served.port not in {0, taken}
        assert served.request("GET", "/")[0] == 200
