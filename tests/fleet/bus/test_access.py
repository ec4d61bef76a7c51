"""Each identity tries everything against the bus of a real edge, over TLS."""

import inspect
import json
import queue
from datetime import UTC, datetime, timedelta

import pytest
from cyberwave.data import DataBus
from cyberwave.data.config import get_backend

from fleet.bus import keys
from fleet.bus.access import Access, access_control, rules_of
from fleet.bus.bus import join, open_edge
from fleet.bus.settings import BusSettings, BusTls, zenoh_settings
from fleet.bus.zenoh_session import ZenohSession
from fleet.config.certificates import Identity, issue_pair, make_authority
from fleet.errors import BusError
from fleet.model.permission import Permission
from tests.tools.waiting import wait_until

OURS = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
THEIRS = "0b7e7a52-3c1d-4f08-8f6e-5d2a9c4b1e73"
PEOPLE = {"anna": "operate", "vic": "view"}
ROLES = {"barn": "edge", "arms": "worker", "desk": "console", "planner": "program", "hub": "router", **PEOPLE}
STRANGER = "stranger"
BARRIER = "fleet/barrier/stop"

PUT = {
    f"cw/{OURS}/data/position": {"arms", "hub"},
    f"cw/{THEIRS}/data/position": {"barn", "arms", "hub"},
    f"cw/{OURS}/data/depth/front": {"planner", "arms", "hub"},
    f"cw/{OURS}/data/model_output": {"planner", "arms", "hub"},
    f"cw/{OURS}/data/lidar": {"planner", "arms", "hub"},
    f"cw/{OURS}/data/telemetry": {"arms", "hub"},
    f"cw/{OURS}/data/commands/velocity": {"planner", "hub"},
    "fleet/yard/robots/rex/state": {"arms", "hub"},
    "fleet/yard/workers/arms/beat": {"arms", "hub"},
    "fleet/yard/workers/legs/beat": {"hub"},
    "fleet/yard/workers/arms/halt": {"hub"},
    "fleet/yard/places/arms": {"arms", "hub"},
    "fleet/yard/places/main": {"hub"},
    "fleet/yard/frames/arms": {"arms", "hub"},
    "fleet/yard/frames/main": {"hub"},
    "fleet/yard/holders": {"hub"},
    "fleet/yard/held": {"hub"},
    f"cw/{OURS}/data/streams/front": {"planner", "arms", "hub"},
    "fleet/yard/health": {"hub"},
    "fleet/yard/runs/3f2a": {"hub"},
    "fleet/barn/runs/3f2a": {"barn", "hub"},
    "fleet/barn/health": {"barn", "hub"},
    "fleet/yard/summary": {"hub"},
    "fleet/barn/summary": {"barn", "hub"},
    "fleet/barn/robots/max/state": {"barn", "hub"},
    "fleet/yard/stop": {*ROLES, STRANGER},
    "fleet/*/stop": {*ROLES, STRANGER},
}
TOKEN = {
    "fleet/yard": {"hub"},
    "fleet/barn": {"barn", "hub"},
    "fleet/yard/robots/rex": {"arms", "hub"},
    "fleet/yard/workers/arms": {"arms", "hub"},
    "fleet/yard/workers/legs": {"hub"},
    f"fleet/yard/claims/{OURS}/1": {"arms", "hub"},
    f"fleet/barn/claims/{OURS}/1": {"barn", "hub"},
    f"fleet/elsewhere/claims/{OURS}/1": {"hub"},
    "fleet/yard/starts/1": {"desk", "anna", "hub"},
}
REQUEST = {
    "fleet/yard/robots/rex/command": {"desk", "hub"},
    "fleet/*/robots/*/command": {"desk", "hub"},
    "fleet/yard/robots/rex/prepare": {"desk", "hub"},
    "fleet/yard/starts": {"desk", "anna", "hub"},
    "fleet/yard/robots/rex/state": set(ROLES),
    "fleet/yard/health": set(ROLES),
    "fleet/yard/summary": set(ROLES),
    f"cw/{OURS}/data/position": set(ROLES),
    "fleet/yard/stop": {*ROLES, STRANGER},
    "fleet/yard/robots/rex/video": {"arms", "hub"},
    "fleet/yard/history": {"desk", *PEOPLE, "hub"},
    "fleet/yard/schedules": {"desk", "hub"},
    "fleet/yard/missions/patrol": {"desk", "hub"},
    "fleet/yard/runs/3f2a": {"desk", "hub"},
    "fleet/yard/robots/rex/command/as/admin/desk": {"desk", "hub"},
    "fleet/yard/runs/3f2a/as/view/desk": {"desk", "hub"},
    "fleet/yard/robots/rex/command/as/view/other": {"hub"},
    "fleet/yard/robots/rex/command/as/root/desk": {"hub"},
    "fleet/yard/robots/rex/command/as/person/anna": {"anna", "hub"},
    "fleet/yard/robots/rex/command/as/person/vic": {"vic", "hub"},  # to be refused with words, and to stop
    "fleet/yard/robots/rex/prepare/as/person/anna": {"anna", "hub"},
    "fleet/yard/missions/patrol/as/person/anna": {"anna", "hub"},
    "fleet/yard/runs/3f2a/as/person/vic": {"vic", "hub"},
    "fleet/yard/schedules/as/person/anna": {"anna", "hub"},
    "fleet/yard/robots/rex/command/as/admin/anna": {"hub"},
    "fleet/yard/robots/rex/command/as/person/nobody": {"hub"},
    "fleet/yard/changes/as/person/anna": {"hub"},
    "fleet/yard/coordinator": {"hub"},
    "fleet/yard/robots/rex/description": set(ROLES),
    "fleet/yard/elsewhere": {"hub"},
    "fleet/yard/failover": {"hub"},  # it moves robots to another edge: for users of the edge's own computer
    "fleet/yard/changes": {"hub"},  # it changes robots: for users of the edge's own computer
    "fleet/yard/workers/arms/hold": {"hub"},  # it configures robots: likewise
    "fleet/yard/workers/arms/reload": {"hub"},  # it loads code: for users of the edge's own computer
}
ANSWER = {
    "fleet/yard/workers/arms/hold": {"arms", "hub"},
    "fleet/yard/workers/arms/reload": {"arms", "hub"},
    "fleet/yard/workers/legs/hold": {"hub"},
    "fleet/yard/workers/legs/reload": {"hub"},
    "fleet/yard/robots/max/command": {"arms", "hub"},
    "fleet/yard/robots/max/command/as/view/desk": {"arms", "hub"},
    "fleet/yard/robots/max/video": {"planner", "hub"},
    "fleet/yard/robots/max/prepare": {"arms", "hub"},
    "fleet/yard/robots/max/prepare/as/person/anna": {"arms", "hub"},
    "fleet/yard/starts": {"arms", "hub"},
    "fleet/yard/history": {"arms", "hub"},
    "fleet/yard/missions/patrol": {"hub"},
    "fleet/yard/runs/3f2a": {"hub"},
    "fleet/yard/robots/max/description": {"arms", "hub"},
    "fleet/yard/health": {"hub"},
    "fleet/barn/health": {"barn", "hub"},
    "fleet/yard/summary": {"hub"},
    "fleet/barn/summary": {"barn", "hub"},
    f"cw/{OURS}/data/gps": {"arms", "hub"},
    f"cw/{OURS}/data/pointcloud": {"planner", "arms", "hub"},
}


def identity(name):
    """Return what the certificate of a name says."""
    return Identity(name, "", ("127.0.0.1",), datetime.now(UTC) + timedelta(days=2))


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    """Make a site's certificates; gives the ``tls`` of a name."""
    folder = tmp_path_factory.mktemp("certs")
    now = datetime.now(UTC)
    authority = make_authority("site", now)
    (folder / "ca.pem").write_bytes(authority.certificate)

    def tls(name):
        paths = folder / f"{name}.pem", folder / f"{name}.key"
        if not paths[0].exists():
            for path, content in zip(paths, issue_pair(authority, identity(name), now), strict=True):
                path.write_bytes(content)
        return BusTls(str(folder / "ca.pem"), *map(str, paths), mutual=True)

    return tls


@pytest.fixture
def there(free_port):
    return f"tls/127.0.0.1:{free_port}"


@pytest.fixture
def yard(directory, opened, certificates, there):
    """Open the bus of an edge over TLS, with a role for each identity but the stranger."""
    access = Access(ROLES, twins=(OURS,), channels=("lidar",))
    return opened(
        open_edge(BusSettings("yard", listen=(there,), tls=certificates("yard"), access=access), directory)
    )


@pytest.fixture
def joined(opened, directory, certificates, there, yard):
    """Join the edge as somebody; returns the session."""

    def joined(name):
        settings = BusSettings("away", connect=(there,), tls=certificates(name))
        return opened(join(settings, directory)).reports

    return joined


@pytest.fixture(params=[*ROLES, STRANGER])
def intruder(request, joined):
    """Join as one of the identities; returns its name and its session."""
    return request.param, joined(request.param)


def may(table, name):
    """Return what a table allows a name."""
    return {key for key, names in table.items() if name in names}


def test_each_identity_is_heard_only_where_it_has_something_to_say(yard, intruder):
    name, bus_session = intruder
    heard = queue.Queue()
    for each in (yard.reports, yard.control):
        each.subscribe("**", lambda key, _payload: heard.put(key))

    def put():
        for key in PUT:
            bus_session.put(key, b"x")

    wait_until("what may be heard is", lambda: put() or may(PUT, name) <= set(heard.queue))
    put()
    round_trip(yard, bus_session)
    assert set(heard.queue) - {BARRIER} == may(PUT, name)


def test_each_identity_shows_only_tokens_of_its_own(yard, intruder):
    name, bus_session = intruder
    seen = queue.Queue()
    yard.control.watch_tokens("**", lambda key, alive: seen.put(key) if alive else None)
    for key in TOKEN:
        bus_session.token(key)
    wait_until("those that may be seen are", lambda: may(TOKEN, name) <= set(seen.queue))
    round_trip(yard, bus_session)
    assert set(seen.queue) == may(TOKEN, name)


def test_each_identity_asks_only_what_it_may(yard, intruder):
    name, bus_session = intruder
    requested = queue.Queue()

    def answer(question):
        requested.put(question.requested)
        question.reply(b"yes")
        question.close()

    for key in REQUEST:
        if "*" not in key:
            (yard.control if key.startswith("fleet") else yard.reports).declare_queryable(key, answer)
    wait_until(
        "those that may be asked answer",
        lambda: all(list(bus_session.request(key, b"", timeout=1.0)) for key in may(REQUEST, name)),
    )
    for key in set(REQUEST) - may(REQUEST, name):
        assert list(bus_session.request(key, b"", timeout=0.3)) == []
    assert set(requested.queue) == may(REQUEST, name)


def test_each_identity_answers_only_for_itself(yard, intruder):
    name, bus_session = intruder

    def answer(question):
        question.reply(b"forged")
        question.close()

    for key in ANSWER:
        bus_session.declare_queryable(key, answer)
    wait_until(
        "those that may answer do",
        lambda: all(list(yard.control.request(key, b"", timeout=1.0)) for key in may(ANSWER, name)),
    )
    for key in set(ANSWER) - may(ANSWER, name):
        assert list(yard.control.request(key, b"", timeout=0.3)) == []


def round_trip(yard, bus_session):
    """Wait until all that an identity has sent before has come, or was refused."""
    heard = queue.Queue()
    yard.control.subscribe(BARRIER, lambda *sample: heard.put(sample))
    wait_until("a stop comes", lambda: bus_session.put(BARRIER, b"") or not heard.empty())


def test_what_somebody_must_not_say_is_not_heard_by_others_over_the_edge_either(yard, joined):
    stranger, barn, planner = joined(STRANGER), joined("barn"), joined("planner")
    heard = queue.Queue()
    planner.subscribe("**", lambda key, _payload: heard.put(key))
    for forger in (stranger, barn):
        for _ in range(3):
            forger.put(f"cw/{OURS}/data/position", b"forged")
    round_trip(yard, barn)
    key = f"cw/{OURS}/data/battery"
    wait_until("the edge is heard", lambda: yard.reports.put(key, b"true") or key in heard.queue)
    assert set(heard.queue) - {BARRIER} == {key}


def test_who_has_no_role_hears_nothing(yard, joined):
    stranger, planner = joined(STRANGER), joined("planner")
    heard, others = queue.Queue(), queue.Queue()
    stranger.subscribe("**", lambda key, _payload: heard.put(key))
    stranger.watch_tokens("**", lambda key, _alive: heard.put(key))
    planner.subscribe("**", lambda key, _payload: others.put(key))
    yard.control.token("fleet/yard")
    key = f"cw/{OURS}/data/battery"
    wait_until("others hear the edge", lambda: yard.reports.put(key, b"true") or key in others.queue)
    answered = [list(stranger.request(requested, b"", timeout=0.3)) for requested in ("fleet/yard/stop", key)]
    assert (answered, list(heard.queue)) == ([[], []], [])


def test_what_is_on_the_links_is_shown_only_to_consoles_and_routers(yard, joined):
    heard = {name: queue.Queue() for name in ROLES}
    for name, received in heard.items():
        joined(name).subscribe("fleet/**", lambda key, _payload, received=received: received.put(key))
    frames, after = "fleet/yard/frames/main", "fleet/yard/health"

    def put():
        yard.reports.put(frames, b"{}")
        yard.reports.put(after, b"{}")

    wait_until("all hear", lambda: put() or all(after in received.queue for received in heard.values()))
    wait_until("those who may", lambda: put() or all(frames in heard[who].queue for who in ("desk", "hub")))
    assert {name for name, received in heard.items() if frames in received.queue} == {"desk", "hub"}


def test_the_sdk_on_another_computer_joins_by_its_certificate(yard, opened, certificates, there, monkeypatch):
    tls = certificates("planner")
    options = f"root_ca_certificate_file={tls.root_ca};connect_certificate_file={tls.certificate};"
    options += f"connect_private_key_file={tls.key};enable_mtls=true"
    monkeypatch.setenv("ZENOH_CONNECT", f"{there}#{options}")
    monkeypatch.setenv("ZENOH_MODE", "client")
    bus = opened(DataBus(opened(get_backend()), twin_uuid=OURS))
    heard = queue.Queue()
    yard.reports.subscribe(f"cw/{OURS}/**", lambda key, _payload: heard.put(key))
    key = f"cw/{OURS}/data/commands/velocity"

    def drive():
        bus.publish("position", {"x": 66.0})
        bus.publish("commands/velocity", {"linear_x": 0.2})
        return key in heard.queue

    wait_until("a velocity crosses", drive)
    assert set(heard.queue) == {key}


def test_every_key_of_the_fleet_is_given_to_somebody_or_kept():
    """Who adds a key decides here, in PUT, TOKEN, ASK or ANSWER, and in the rules, who may use it."""
    decided = {"edge", "robot", "claim", "claims", "command", "holders", "positions", "state", "worker"}
    decided |= {"heartbeat", "halt", "health", "stop", "held", "video", "history", "description"}
    decided |= {"prepare", "starts", "starting", "schedules"}
    decided |= {
        "mission",
        "run",
        "hold",
        "reload",
        "coordinator",
        "as_console",
        "as_person",
        "changes",
        "frames",
        "failover",
    }
    decided |= {"summary"}
    assert {name for name, _ in inspect.getmembers(keys, inspect.isfunction)} == decided


def test_who_comes_by_the_socket_may_do_everything(yard, opened, directory):
    bus_session = opened(join(BusSettings("yard"), directory)).reports
    heard = queue.Queue()
    yard.control.subscribe("fleet/yard/holders", lambda *sample: heard.put(sample))
    wait_until("it is heard", lambda: bus_session.put("fleet/yard/holders", b"x") or not heard.empty())


def test_an_edge_that_joins_as_a_peer_is_held_to_the_same_rules(yard, opened, certificates, there):
    settings = BusSettings("barn", connect=(there,), tls=certificates("barn"))
    peer = zenoh_settings(settings, mode="peer", listen=(), connect=(there,))
    barn = opened(ZenohSession({**peer, "transport/link/protocols": ["tls"]}))  # as on another computer
    heard = queue.Queue()
    yard.control.subscribe("fleet/**", lambda key, _payload: heard.put(key))
    wait_until("it is heard", lambda: barn.put("fleet/barn/health", b"") or not heard.empty())
    for key in ("fleet/yard/holders", "fleet/yard/workers/arms/beat"):
        barn.put(key, b"forged")
    round_trip(yard, barn)
    assert set(heard.queue) - {BARRIER} == {"fleet/barn/health"}


def test_a_certificate_of_another_site_does_not_come_in(yard, directory, there, tmp_path):
    now = datetime.now(UTC)
    other = make_authority("other", now)
    names = tmp_path / "ca.pem", tmp_path / "desk.pem", tmp_path / "desk.key"
    for path, content in zip(
        names, (other.certificate, *issue_pair(other, identity("desk"), now)), strict=True
    ):
        path.write_bytes(content)
    tls = BusTls(*map(str, names), mutual=True, verify_name=False)
    with pytest.raises(BusError, match="cannot join the bus"):
        join(BusSettings("away", connect=(there,), tls=tls), directory)


def test_the_rules_name_no_robot_so_that_one_may_be_added():
    rules = access_control(Access(ROLES, twins=(OURS,)), "yard", ["tls"])["rules"]
    allowed = [key for rule in rules if rule["permission"] == "allow" for key in rule["key_exprs"]]
    assert not [key for key in allowed if "robots" in key and "robots/*" not in key]
    assert OURS not in json.dumps(allowed)


def test_only_an_edge_that_coordinates_its_robots_may_command_them():
    access = Access({"barn": "edge", "shed": "edge"}, coordinators=frozenset({"shed"}))

    def requests(name):
        rules = rules_of("edge", name, "yard", access)
        return {key for rule in rules if "query" in rule.messages for key in rule.keys}

    assert requests("shed") - requests("barn") == {"fleet/yard/coordinator", "fleet/yard/robots/*/command"}


def test_a_console_that_may_only_show_asks_by_no_key_that_moves_a_robot():
    access = Access({"wall": "console", "desk": "console"}, consoles={"wall": Permission.VIEW})

    def requests(name):
        rules = rules_of("console", name, "yard", access)
        return {key for rule in rules if "query" in rule.messages for key in rule.keys}

    shown = {
        f"fleet/*/{key}/as/view/wall" for key in ("robots/*/command", "missions/*", "runs/*", "schedules")
    }
    assert requests("wall") == {"fleet/*/history", *shown}
    assert {"fleet/*/robots/*/command", "fleet/*/robots/*/command/as/admin/desk"} <= requests("desk")


def test_a_console_whose_users_may_operate_answers_offers_of_video_and_puts_nothing_else():
    access = Access({"wall": "console", "desk": "console"}, consoles={"wall": Permission.VIEW})

    def puts(name):
        rules = rules_of("console", name, "yard", access)
        return {key for rule in rules if "put" in rule.messages for key in rule.keys}

    assert (puts("wall"), puts("desk")) == (set(), {"cw/*/data/local/webrtc_answer"})
