"""``fleet console``: a link to a page, from any terminal of this user."""

import re
import socket
import subprocess
import sys

import pytest

from fleet.testing.waiting import DEADLINE

LINK = re.compile(r"http://127\.0\.0\.1:\d+/#token=\S{40,}")


def test_without_a_console_there_is_no_link(fleet, runtime):
    result = fleet("console", "--link")
    assert (result.code, "no console is running here; start one with: fleet console" in result.err) == (
        4,
        True,
    )


@pytest.fixture
def running(runtime):
    command = [sys.executable, "-m", "fleet", "console", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        yield process
        process.kill()


def test_it_runs_without_any_edge_prints_a_link_and_another_for_each_that_asks(fleet, running):
    first = running.stdout.readline().strip()
    assert LINK.fullmatch(first)
    second = fleet("console", "--link", "--permission", "view")
    assert LINK.fullmatch(second.out.strip())
    assert second.out.strip() != first
    running.terminate()
    assert running.wait(DEADLINE) == 0


def test_a_port_that_cannot_be_opened_is_an_error(runtime):
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        command = [sys.executable, "-m", "fleet", "console", "--port", port]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE, check=False)
    assert ended.returncode == 1
    assert f"port {port} on 127.0.0.1 cannot be opened: Address already in use" in ended.stderr
