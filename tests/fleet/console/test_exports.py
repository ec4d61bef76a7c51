"""A window of the recordings as a file: who may have it, and how much of it."""

import asyncio
import json
import socket

import pytest

from fleet.console import exports
from fleet.console.exports import Exports, ExportWindow
from fleet.console.sessions import ConsoleUser
from fleet.errors import Refused
from fleet.model.permission import Permission
from fleet.record.export import recorded
from tests.tools.recordings import write_recording
from tests.tools.waiting import DEADLINE, wait_until

BEGINS, SECONDS = 1_795_000_000.0, 10
ADAM = ConsoleUser("adam", Permission.ADMIN)
WINDOW = {"since": BEGINS + 2, "until": BEGINS + 6}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Write a recording."""
    folder = tmp_path_factory.mktemp("export") / "recordings"
    write_recording(folder, BEGINS, SECONDS)
    return folder


@pytest.fixture(scope="module")
def served(runtime, serve_console, recordings):
    """Serve a console with a recording."""
    folders = (str(recordings), str(recordings / "none"))
    with serve_console(runtime, "export", recordings=folders) as served:
        yield served


def request(served, window=WINDOW, permission=Permission.ADMIN, **headers):
    headers.setdefault("cookie", served.cookie(permission))
    return served.post("/api/recording", window, **headers)


def test_a_window_is_a_whole_file_that_foxglove_opens(served, tmp_path):
    status, headers, body = request(served)
    (tmp_path / "window.mcap").write_bytes(body)
    found = recorded(tmp_path / "window.mcap")
    assert (status, headers["content-type"]) == (200, "application/octet-stream")
    assert (found.begins, found.ends) == (BEGINS + 2, BEGINS + 5.5)
    assert found.messages > 30


@pytest.mark.parametrize("permission", [Permission.VIEW, Permission.OPERATE])
def test_it_needs_the_permission_admin(served, permission):
    status, _, body = request(served, permission=permission)
    assert (status, "admin" in json.loads(body)["error"]) == (403, True)


def test_nobody_has_it_without_a_session_its_proof_or_from_another_origin(served):
    assert request(served, cookie=None)[0] == 401
    assert request(served, x_fleet_proof="guess")[0] == 401
    assert request(served, origin="http://elsewhere.example")[0] == 403
    assert served.request("GET", "/api/recording", cookie=served.cookie())[0] in (404, 405)


@pytest.mark.parametrize(
    ("window", "status", "words"),
    [
        ({"since": BEGINS, "until": BEGINS + exports.LONGEST + 1}, 403, "30 min"),
        ({"since": BEGINS + 5, "until": BEGINS + 5}, 403, "begins before"),
        ({"since": -5, "until": 5}, 403, "begins before"),
        ({"since": 5, "until": 10}, 403, "nothing is recorded"),
        ({"since": BEGINS}, 400, "cannot be read"),
        ({"since": BEGINS, "until": BEGINS + 1, "folder": "/etc"}, 400, "cannot be read"),
        (b'{"since": NaN, "until": 1}', 400, "cannot be read"),
        (b"[" * 5000, 400, "cannot be read"),
    ],
)
def test_what_is_no_window_of_a_recording_is_refused_with_the_reason(served, window, status, words):
    found, _, body = request(served, window)
    assert (found, words in json.loads(body)["error"]) == (status, True)


async def exported(exports):
    """Export a window; return the bytes of its file."""
    async with exports.export(ExportWindow(**WINDOW), ADAM) as export:
        return b"".join([block async for block in export.blocks()])


async def test_of_windows_that_are_asked_for_at_once_one_is_exported(recordings):
    exports = Exports(lambda: [recordings])
    found = await asyncio.gather(*(exported(exports) for _ in range(4)), return_exceptions=True)
    assert [type(each) for each in found].count(Refused) == 3
    assert [each[1:5] for each in found if isinstance(each, bytes)] == [b"MCAP"]
    assert await exported(exports)


async def test_an_export_of_which_nothing_is_read_ends_with_who_asked(recordings):
    exports = Exports(lambda: [recordings])
    async with exports.export(ExportWindow(**WINDOW), ADAM):
        with pytest.raises(Refused, match="another window"):
            await exported(exports)
    assert await exported(exports)


async def test_an_export_that_is_cancelled_while_it_begins_leaves_room_for_the_next(recordings):
    exports = Exports(lambda: [recordings])
    requested = asyncio.create_task(exported(exports))
    await asyncio.sleep(0)
    requested.cancel()
    await asyncio.gather(requested, return_exceptions=True)
    assert await exported(exports)


def test_a_browser_that_leaves_at_once_leaves_room_for_the_next(served):
    body = json.dumps(WINDOW).encode()
    cookie = served.cookie()
    head = {
        "Host": f"127.0.0.1:{served.port}",
        "Origin": served.base,
        "Cookie": cookie,
        "X-Fleet-Proof": served.proofs[cookie],
        "Content-Type": "application/json",
        "Content-Length": str(len(body)),
    }
    lines = "".join(f"{name}: {value}\r\n" for name, value in head.items())
    with socket.create_connection(("127.0.0.1", served.port), timeout=DEADLINE) as gone:
        gone.sendall(f"POST /api/recording HTTP/1.1\r\n{lines}\r\n".encode() + body)
    wait_until("room", lambda: request(served)[0] == 200)
