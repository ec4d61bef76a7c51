"""``fleet console``: a link to a page, from any terminal of this user."""

import json
import re
import socket
import subprocess
import sys
from datetime import UTC, datetime, timedelta

import pytest

from fleet.bus.access import Access
from fleet.bus.settings import BusTls
from fleet.config.certificates import Identity, issue_pair, make_authority
from fleet.console.people import Person, add_person
from tests.tools.passwords import quick_hash
from tests.tools.waiting import DEADLINE, wait_until

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
    viewed = fleet("console", "--foxglove").out.strip()
    assert re.fullmatch(r"ws://127\.0\.0\.1:\d+/foxglove/\S{40,}", viewed)
    running.terminate()
    assert running.wait(DEADLINE) == 0


def test_a_port_that_cannot_be_opened_is_an_error(runtime):
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        command = [sys.executable, "-m", "fleet", "console", "--port", port]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE, check=False)
    assert ended.returncode == 1
    assert f"port {port} on 127.0.0.1 cannot be opened: Address already in use" in ended.stderr


PASSWORD = "correct horse battery"
OFFICE = """
edge: {{id: office}}
bus:
  connect: [tls/127.0.0.1:{bus}]
  tls: {{root_ca: ca.pem, cert: office.pem, key: office.key}}
console:
  {{port: 0, listen: '127.0.0.1:{login}', tls: {{cert: office.pem, key: office.key}}, people: people.json}}
"""


@pytest.fixture
def ports():
    """Find two ports that nobody uses."""
    with socket.create_server(("127.0.0.1", 0)) as one, socket.create_server(("127.0.0.1", 0)) as other:
        return one.getsockname()[1], other.getsockname()[1]


@pytest.fixture
def office(place, ports):
    """Write the file of a console without an edge, with its certificates and a person, into a folder."""
    now = datetime.now(UTC)
    authority = make_authority("site", now)
    (place / "ca.pem").write_bytes(authority.certificate)
    for name, role in (("yard-1", "edge"), ("office", "console")):
        pair = issue_pair(authority, Identity(name, role, ("127.0.0.1",), now + timedelta(days=1)), now)
        (place / f"{name}.pem").write_bytes(pair.certificate)
        (place / f"{name}.key").write_bytes(pair.key)
    (place / "office.yaml").write_text(OFFICE.format(bus=ports[0], login=ports[1]))
    add_person(place / "people.json", Person("anna", "operate", quick_hash(PASSWORD)))
    return place


@pytest.fixture
def far_edge(office, ports, play_edge):
    """Play an edge that lets the office's console in by its certificate."""
    names = (str(office / name) for name in ("ca.pem", "yard-1.pem", "yard-1.key"))
    return play_edge(
        "yard-1",
        robots={"rex": {"health": "ok", "reachable": True}},
        listen=(f"tls/127.0.0.1:{ports[0]}",),
        tls=BusTls(*names, mutual=True),
        access=Access({"office": "console"}),
    )


@pytest.fixture
def beyond(office, ports, module_at, background_loop):
    """Return the way to the port of the office's console on which people log in."""
    return module_at("fleet/console/test_login_server.py").Beyond(office, ports[1], background_loop)


@pytest.fixture
def start_office(office, runtime):
    """Serve the console of the office's file; returns its process."""
    served = []

    def start_office():
        command = [sys.executable, "-m", "fleet", "console", "-f", "office.yaml"]
        pipe = subprocess.PIPE
        served.append(subprocess.Popen(command, cwd=office, stdout=pipe, stderr=pipe, text=True))
        return served[-1]

    yield start_office
    for process in served:
        process.terminate()
        process.communicate(timeout=DEADLINE)


def test_people_log_in_at_a_console_without_an_edge_and_command_in_their_name(
    fleet, far_edge, start_office, beyond
):
    sent = far_edge.answers("rex")
    start_office().stdout.readline()
    wait_until("the port", lambda: _answers(beyond.port))
    shown, session = beyond.log_in()
    assert (session["operator"], session["permission"]) == ("anna", "operate")
    with beyond.page(shown) as page:
        while "yard-1/rex" not in json.loads(page.recv(timeout=DEADLINE)).get("robots", {}):
            pass
        page.send(json.dumps({"ask": "command", "request": "1", "robot": "yard-1/rex", "command": "beep"}))
        wait_until("the command", lambda: sent)
    assert sent[0].suffix == "/as/operate/office"
    assert beyond.post("/api/stop", {"ask": "stop", "request": "stop-1"}, **shown)[0] == 200
    assert far_edge.stops == [[]]

    def logins():
        return [each["text"] for each in fleet("history", "-f", "office.yaml", "--json").json]

    found = wait_until("the login in the history", logins)
    assert found == ["anna logged in at the console, from 127.0.0.1"]


def test_the_login_of_an_edge_that_runs_here_is_left_to_the_console_beside_it(
    office, play_edge, ports, start_office
):
    play_edge("office")
    assert LINK.fullmatch(start_office().stdout.readline().strip())
    assert not _answers(ports[1])


def test_a_login_whose_certificate_cannot_be_used_is_an_error(office, start_office):
    (office / "office.key").write_bytes(b"garbage")
    process = start_office()
    assert process.wait(DEADLINE) == 1
    assert "console.tls cannot be used" in process.stderr.read()


def _answers(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
