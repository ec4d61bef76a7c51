"""A window of the recordings as a file: who may have it, and how much of it."""

import json
import threading

import pytest

from fleet.console import exports
from fleet.model.permission import Permission
from fleet.record.export import recorded
from tests.tools.recordings import write_recording

BEGINS, SECONDS = 1_795_000_000.0, 10
WINDOW = {"since": BEGINS + 2, "until": BEGINS + 6}


@pytest.fixture(scope="module")
def served(runtime, serve_console, tmp_path_factory):
    """Serve a console with a recording."""
    folder = tmp_path_factory.mktemp("export") / "recordings"
    write_recording(folder, BEGINS, SECONDS)
    with serve_console(runtime, "export", recordings=(str(folder), str(folder / "none"))) as served:
        yield served


def ask(served, window=WINDOW, permission=Permission.ADMIN, **headers):
    headers.setdefault("cookie", served.cookie(permission))
    return served.post("/api/recording", window, **headers)


def test_a_window_is_a_whole_file_that_foxglove_opens(served, tmp_path):
    status, headers, body = ask(served)
    (tmp_path / "window.mcap").write_bytes(body)
    found = recorded(tmp_path / "window.mcap")
    assert (status, headers["content-type"]) == (200, "application/octet-stream")
    assert (found.begins, found.ends) == (BEGINS + 2, BEGINS + 5.5)
    assert found.messages > 30


@pytest.mark.parametrize("permission", [Permission.VIEW, Permission.OPERATE])
def test_it_needs_the_permission_admin(served, permission):
    status, _, body = ask(served, permission=permission)
    assert (status, "admin" in json.loads(body)["error"]) == (403, True)


def test_nobody_has_it_without_a_session_its_proof_or_from_another_origin(served):
    assert ask(served, cookie=None)[0] == 401
    assert ask(served, x_fleet_proof="guess")[0] == 401
    assert ask(served, origin="http://elsewhere.example")[0] == 403
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
    found, _, body = ask(served, window)
    assert (found, words in json.loads(body)["error"]) == (status, True)


def test_after_windows_that_were_asked_for_at_once_there_is_room_for_the_next(served):
    statuses = []
    threads = [threading.Thread(target=lambda: statuses.append(ask(served)[0])) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert set(statuses) <= {200, 403}
    assert 200 in statuses
    assert ask(served)[0] == 200
