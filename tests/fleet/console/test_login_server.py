"""The console beyond loopback, over real TLS: one line for each attempt, and that who belongs gets in."""

import asyncio
import contextlib
import http.client
import json
import socket
import ssl
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from fleet.config.certificates import Identity, issue_pair, make_authority
from fleet.console.login_history import HistoryPlace
from fleet.console.login_links import ConsoleError
from fleet.console.login_server import LoginServer
from fleet.console.people import Person, add_person, change_person, remove_person
from fleet.console.request_guard import POLICY
from fleet.console.task import LoginTask
from fleet.history.event_filter import EventFilter
from fleet.history.reader import read
from fleet.testing.clock import ManualClock
from tests.tools.passwords import quick_hash
from tests.tools.ports import free_ports
from tests.tools.waiting import DEADLINE, wait_until

PASSWORD = "correct horse battery"
WAIT = 60_000  # ms; busy computers are slow
AXE = Path(__file__).parents[2] / "data" / "axe" / "axe.min.js"  # axe-core 4.14.1, unchanged
HOSTS = ("127.0.0.1", "console.test")


def write_certificate(folder, hosts=HOSTS):
    """Write the certificate of a console and of its authority into a folder."""
    now = datetime.now(UTC)
    authority = make_authority("site", now)
    pair = issue_pair(authority, Identity("web", "console", hosts, now + timedelta(days=1)), now)
    for name, content in (
        ("ca.pem", authority.certificate),
        ("web.pem", pair.certificate),
        ("web.key", pair.key),
    ):
        (folder / name).write_bytes(content)


def task_in(folder, port, **fields):
    """Return the login of a console whose files are in a folder."""
    cert, key, people = (str(folder / name) for name in ("web.pem", "web.key", "people.json"))
    place = HistoryPlace(str(folder / "state"), 1 << 20, 86400.0)
    return LoginTask("127.0.0.1", port, cert, key, people, place, **fields)


class Beyond:
    """The way to a console's port with TLS, as a browser goes it."""

    def __init__(self, folder, port, loop):
        self.loop = loop
        self.folder, self.port, self.base = folder, port, f"https://127.0.0.1:{port}"
        self.context = ssl.create_default_context(cafile=str(folder / "ca.pem"))

    def request(self, method, path, *, body=None, source="127.0.0.1", **headers):
        connection = http.client.HTTPSConnection(
            "127.0.0.1", self.port, context=self.context, timeout=DEADLINE, source_address=(source, 0)
        )
        with contextlib.closing(connection):
            connection.putrequest(method, path, skip_host="host" in headers)
            for name, value in headers.items():
                if value is not None:
                    connection.putheader(name.replace("_", "-"), value)
            connection.endheaders(body)
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()

    def post(self, path, content, **headers):
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        usual = {"origin": self.base, "content_type": "application/json", "content_length": str(len(body))}
        return self.request("POST", path, body=body, **(usual | headers))

    def log_in(self, name="anna", password=PASSWORD, **headers):
        """Log in; return the headers by which the session is shown, and what was told."""
        status, answered, body = self.post("/api/login", {"name": name, "password": password}, **headers)
        assert status == 200, body
        session = json.loads(body)
        cookie = answered["set-cookie"].partition(";")[0]
        return {"cookie": cookie, "x_fleet_proof": session["proof"]}, session

    def status(self, shown):
        return self.request("GET", "/api/session", **shown)[0]

    @contextlib.contextmanager
    def page(self, shown):
        """Open the WebSocket of a page."""

        async def opened():
            return await connect(
                f"wss://127.0.0.1:{self.port}/ws",
                ssl=self.context,
                origin=self.base,
                additional_headers={"Cookie": shown["cookie"]},
                subprotocols=["fleet.console", shown["x_fleet_proof"]],
                open_timeout=DEADLINE,
            )

        page = Page(self.loop.complete(opened()), self.loop)
        try:
            yield page
        finally:
            self.loop.complete(page.socket.close())


class Page:
    """A WebSocket on a loop: websockets' client with threads reads and writes one TLS object at once."""

    def __init__(self, socket, loop):
        self.socket = socket
        self._loop = loop

    def recv(self, timeout):
        return self._loop.complete(asyncio.wait_for(self.socket.recv(), timeout))

    def send(self, text):
        self._loop.complete(self.socket.send(text))


@pytest.fixture(scope="module")
def kept():
    """Hash the password of all once."""
    return quick_hash(PASSWORD)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("beyond")
    write_certificate(folder)
    return folder


@pytest.fixture(scope="module")
def beyond(runtime, serve_console, folder, kept, background_loop):
    """Serve a console beyond loopback, at which three people may log in."""
    for name, permission in (("anna", "operate"), ("vera", "view"), ("adam", "admin")):
        add_person(folder / "people.json", Person(name, permission, kept))
    (port,) = free_ports(1)
    with serve_console(runtime, "beyond", login=task_in(folder, port)) as served:
        beyond = Beyond(folder, port, background_loop)
        beyond.console = served
        wait_until("the port", lambda: _answers(port))
        yield beyond


def _answers(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@pytest.fixture
def person(beyond, kept):
    """Add somebody for one test, with this permission; return the name."""
    path = beyond.folder / "people.json"
    with contextlib.ExitStack() as stack:

        def person(name, permission="operate"):
            add_person(path, Person(name, permission, kept))

            def remove():
                with contextlib.suppress(Exception):
                    remove_person(path, name)

            stack.callback(remove)
            return name

        yield person


@pytest.fixture(scope="module")
def yard(play_edge):
    return play_edge("yard-1", robots={"rex": {"health": "ok", "reachable": True}})


def test_a_login_opens_a_session_with_a_cookie_that_only_this_site_over_tls_is_sent(beyond):
    status, headers, body = beyond.post("/api/login", {"name": "anna", "password": PASSWORD})
    session = json.loads(body)
    assert (status, session["operator"], session["permission"]) == (200, "anna", "operate")
    name, *flags = headers["set-cookie"].split("; ")
    assert name.startswith("__Host-fleet_console_")
    assert {"HttpOnly", "SameSite=strict", "Secure", "Path=/"} <= set(flags)
    assert not any(flag.lower().startswith(("domain", "expires", "max-age")) for flag in flags)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ({"name": "anna", "password": "wrong horse battery"}, 403),
        ({"name": "nobody-here", "password": PASSWORD}, 403),
        ({"name": "Anna", "password": PASSWORD}, 403),
        ({"name": "", "password": ""}, 403),
        ({"name": "x" * 65, "password": PASSWORD}, 400),
        ({"name": "anna", "password": "x" * 1025}, 400),
        ({"name": "anna", "password": PASSWORD, "permission": "admin"}, 400),
        ({"name": ["anna"], "password": PASSWORD}, 400),
        ({"token": "guess"}, 400),
        (b"garbage", 400),
    ],
)
def test_what_is_not_a_name_with_its_password_opens_no_session(beyond, content, expected):
    status, headers, _ = beyond.post("/api/login", content, source="127.0.0.2")
    assert (status, headers["set-cookie"]) == (expected, None)


def test_a_token_of_a_link_is_good_on_loopback_only_and_a_password_only_beyond_it(beyond):
    assert beyond.post("/api/session", {"token": beyond.console.token()})[0] in {404, 405}
    assert beyond.console.post("/api/login", {"name": "anna", "password": PASSWORD})[0] in {404, 405}


def test_sessions_of_loopback_and_beyond_are_not_good_for_each_other(beyond):
    shown, _ = beyond.log_in()
    cookie = beyond.console.cookie()
    proof = beyond.console.proofs[cookie]
    assert beyond.status({"cookie": cookie, "x_fleet_proof": proof}) == 401
    assert beyond.console.request("GET", "/api/session", **shown)[0] == 401


def test_a_cookie_of_another_instance_is_no_good(beyond):
    shown, _ = beyond.log_in()
    name, _, value = shown["cookie"].partition("=")
    other = f"{name[:-1]}{'0' if name[-1] != '0' else '1'}={value}"
    assert beyond.status(shown | {"cookie": other}) == 401
    assert beyond.status(shown) == 200


def test_a_cookie_without_its_proof_is_worth_nothing(beyond):
    shown, _ = beyond.log_in()
    other, _ = beyond.log_in("vera")
    for proof in (None, "guess", other["x_fleet_proof"]):
        assert beyond.status(shown | {"x_fleet_proof": proof}) == 401


def test_a_cookie_that_is_replayed_after_logout_is_no_good_and_its_page_is_closed(beyond):
    shown, _ = beyond.log_in()
    with beyond.page(shown) as page:
        page.recv(timeout=DEADLINE)
        assert beyond.post("/api/logout", {}, **shown)[0] == 200
        with pytest.raises(ConnectionClosed) as closed:
            _read_to_the_end(page)
    assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (4401, "the session has ended")
    assert beyond.status(shown) == 401
    session = json.loads(beyond.request("GET", "/api/session", **shown)[2])
    assert session["login"] == "/login.html"
    assert beyond.post("/api/stop", {"ask": "stop", "request": "late"}, **shown)[0] == 401
    assert beyond.post("/api/logout", {}, **shown)[0] == 401


@pytest.mark.parametrize(
    "change",
    [remove_person, lambda path, name: change_person(path, name, permission="view")],
    ids=["removed", "lowered"],
)
def test_who_is_removed_or_may_do_less_has_no_session_and_no_page_any_more(beyond, person, change):
    name = person("gone", "admin")
    shown, _ = beyond.log_in(name)
    with beyond.page(shown) as page:
        page.recv(timeout=DEADLINE)
        change(beyond.folder / "people.json", name)
        assert beyond.status(shown) == 401
        with pytest.raises(ConnectionClosed) as closed:
            _read_to_the_end(page)
    assert closed.value.rcvd.code == 4401


def test_who_may_only_view_may_stop_and_nothing_else(beyond, yard):
    shown, session = beyond.log_in("vera")
    assert session["permission"] == "view"
    with beyond.page(shown) as page:
        page.send(json.dumps({"ask": "release", "request": "r1", "robots": ["yard-1/rex"]}))
        answer = _answer(page, "r1")
        assert answer["reason"] == "it needs the permission operate; yours is view"
    status, _, body = beyond.post("/api/stop", {"ask": "stop", "request": "s1", "robots": []}, **shown)
    assert (status, json.loads(body)["by"]) == (200, "vera")


def _read_to_the_end(page):
    while True:
        page.recv(timeout=DEADLINE)


def _answer(page, request):
    while True:
        message = json.loads(page.recv(timeout=DEADLINE))
        if message.get("request") == request:
            return message


def test_after_failed_logins_a_name_waits_with_the_right_password_too_and_the_history_tells(beyond, person):
    name = person("locked")
    wrong = {"name": name, "password": "wrong horse battery"}
    codes = [beyond.post("/api/login", wrong, source="127.0.0.3")[0] for _ in range(6)]
    assert codes == [403] * 6
    status, headers, body = beyond.post("/api/login", {"name": name, "password": PASSWORD})
    assert (status, b"too many failed logins: try again in" in body) == (429, True)
    assert int(headers["retry-after"]) >= 1
    text = "a login at the console as locked failed, from 127.0.0.3; the next try waits 2 s"
    state = beyond.folder / "state"
    wait_until("the history", lambda: text in [each.text for each in read(state, EventFilter())])


FOREIGN = [
    {"host": "evil.example"},
    {"host": "localhost:{port}"},
    {"host": "10.0.0.5:{port}"},
    {"origin": "https://evil.example"},
    {"origin": "http://127.0.0.1:{port}"},
    {"origin": "https://console.test:{port}"},
    {"origin": "null"},
    {"origin": None},
    {"sec_fetch_site": "cross-site"},
    {"content_type": "application/x-www-form-urlencoded"},
]


@pytest.mark.parametrize("changed", FOREIGN, ids=str)
def test_a_login_from_a_foreign_page_or_by_a_foreign_name_is_refused(beyond, changed):
    headers = {name: value and value.format(port=beyond.port) for name, value in changed.items()}
    status, answered, body = beyond.post("/api/login", {"name": "anna", "password": PASSWORD}, **headers)
    assert (status, answered["set-cookie"], body.startswith(b"refused: ")) == (403, None, True)


def test_it_is_reached_by_each_name_of_its_certificate(beyond):
    for host in ("127.0.0.1", "console.test"):
        base = f"{host}:{beyond.port}"
        shown, _ = beyond.log_in(host=base, origin=f"https://{base}")
        assert beyond.status(shown) == 200


def test_a_websocket_of_a_foreign_page_or_without_a_session_is_not_opened(beyond):
    shown, _ = beyond.log_in()
    requested = {
        "connection": "Upgrade",
        "upgrade": "websocket",
        "sec_websocket_version": "13",
        "sec_websocket_key": "AAAAAAAAAAAAAAAAAAAAAA==",
        "sec_websocket_protocol": f"fleet.console, {shown['x_fleet_proof']}",
        "cookie": shown["cookie"],
        "origin": beyond.base,
    }
    for changed in ({"origin": "https://evil.example"}, {"origin": None}, {"cookie": None}):
        assert beyond.request("GET", "/ws", **(requested | changed))[0] == 403
    with beyond.page(shown) as page:
        assert json.loads(page.recv(timeout=DEADLINE))["operator"] == "anna"


def test_the_login_page_needs_no_session_and_has_the_policy_without_inline_code(beyond):
    status, headers, body = beyond.request("GET", "/login.html")
    assert (status, headers["content-security-policy"]) == (200, POLICY)
    assert b"style=" not in body
    assert body.count(b"<script") == 1


def test_plain_http_learns_where_to_go_and_gets_nothing_else(beyond):
    with socket.create_connection(("127.0.0.1", beyond.port), timeout=DEADLINE) as plain:
        plain.sendall(b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n")
        with plain.makefile("rb") as answer:
            head, _, body = answer.read().partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 400 Bad Request\r\n")
    assert body == f"this port is for https; open {beyond.base}/\n".encode()


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda folder: write_certificate(folder, ()), "names no host"),
        (lambda folder: (folder / "web.key").write_bytes(b"garbage"), "console.tls cannot be used"),
        (lambda folder: (folder / "web.pem").unlink(), "console.tls cannot be used"),
    ],
    ids=["no host", "no key", "no certificate"],
)
def test_a_certificate_that_cannot_be_used_is_reported(tmp_path, spoil, why):
    write_certificate(tmp_path)
    spoil(tmp_path)
    with pytest.raises(ConsoleError, match=why):
        LoginServer(task_in(tmp_path, 0), None, ManualClock())


def test_a_port_that_is_taken_is_reported(tmp_path):
    write_certificate(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(ConsoleError, match=f"port {port} on 127.0.0.1 cannot be opened"):
            LoginServer(task_in(tmp_path, port), None, ManualClock())


@pytest.fixture
def opened(new_page, beyond):
    """Open the console in a real browser."""
    page = new_page(ignore_https_errors=True)
    page.goto(f"{beyond.base}/")
    return page


def test_in_a_browser_one_logs_in_stops_robots_is_removed_and_logs_out(opened, beyond, person, yard):
    page, name = opened, person("bert", "view")
    page.wait_for_url("**/login.html")
    page.evaluate(AXE.read_text())
    found = page.evaluate("axe.run()")["violations"]
    assert [each["id"] for each in found] == []
    page.get_by_label("Name").fill(name)
    page.get_by_label("Password").fill("wrong horse battery")
    page.get_by_role("button", name="Log in").click()
    page.locator("#login-words", has_text="the name or the password is wrong").wait_for()
    assert page.evaluate("document.activeElement.id") == "password"

    page.get_by_label("Password").fill(PASSWORD)
    page.keyboard.press("Enter")
    page.locator("#link-words", has_text="bert · view").wait_for()
    page.wait_for_selector('#robots li[data-id="yard-1/rex"]')
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    script = "[...fleetPage.stops.values()].map((stop) => stop.told && stop.told.by)"
    wait_until("the stop to be told", lambda: "bert" in page.evaluate(script))
    wait_until("the stop to reach the edge", lambda: yard.stops)
    page.reload()
    page.locator("#link-words", has_text="bert · view").wait_for()
    assert page.evaluate("document.cookie") == ""

    change_person(beyond.folder / "people.json", name, permission="operate")
    page.wait_for_url("**/login.html")
    page.get_by_label("Name").fill(name)
    page.get_by_label("Password").fill(PASSWORD)
    page.keyboard.press("Enter")
    page.locator("#link-words", has_text="bert · operate").wait_for()
    page.get_by_role("button", name="Log out").click()
    page.wait_for_url("**/login.html")
    page.goto(f"{beyond.base}/")
    page.wait_for_url("**/login.html")
