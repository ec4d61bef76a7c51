"""Each identity tries to take an edge's robot over TLS: by velocity, command, claim, state and stop."""

import asyncio
import json
from datetime import UTC, datetime, timedelta

import pytest
from cyberwave.data.header import HeaderTemplate

from fleet.bus.bus import join
from fleet.bus.settings import BusSettings, BusTls
from fleet.config.certificates import Identity, issue_pair, make_authority

DRIVES = {"planner", "hub"}
COMMANDS = {"desk", "hub"}
ROLES = {"barn": "edge", "arms": "worker", "desk": "console", "planner": "program", "hub": "router"}
STRANGER = "stranger"
COMMAND = b'{"command": "dance", "source_type": "tele"}'


@pytest.fixture
def place(yard, tmp_path, free_port):
    """Make a yard whose bus is open to the network, with a role for each identity but the stranger."""
    now = datetime.now(UTC)
    authority = make_authority("site", now)
    (tmp_path / "ca.pem").write_bytes(authority.certificate)
    for name in ("yard", *ROLES, STRANGER):
        until = now + timedelta(days=20, hours=1)
        pair = issue_pair(authority, Identity(name, "", ("127.0.0.1",), until), now)
        (tmp_path / f"{name}.pem").write_bytes(pair.certificate)
        (tmp_path / f"{name}.key").write_bytes(pair.key)
    place = yard(rex={"worker": "main"})
    place.there = f"tls/127.0.0.1:{free_port}"
    tls = {"root_ca": "ca.pem", "cert": "yard.pem", "key": "yard.key"}
    bus = {"listen": [place.there], "tls": tls, "access": ROLES}
    place.change(bus=bus, remote_workers=["arms"])
    return place


@pytest.fixture(params=[*ROLES, STRANGER])
def intruder(request, place, tmp_path):
    """Return a name, and what joins as it."""
    name = request.param
    paths = (str(tmp_path / file) for file in ("ca.pem", f"{name}.pem", f"{name}.key"))
    return name, lambda: join(
        BusSettings("away", connect=(place.there,), tls=BusTls(*paths, mutual=True)), tmp_path
    )


async def test_an_identity_takes_from_a_running_edge_only_what_is_its_own(
    place, intruder, run_edge, requests
):
    name, join_as = intruder
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: place.words("rex") == ["run"])
        bus = await asyncio.to_thread(join_as)
        try:
            await attack(bus, place, edge, name, requests)
        finally:
            await asyncio.to_thread(bus.close)


async def test_the_end_of_its_certificate_is_in_the_edges_health(place, run_edge, requests):
    edge = place.edge()
    async with run_edge(edge):
        expected = "certificate yard.pem expires in 20 days, on "
        await requests.until(lambda: expected in edge.state().cause)
        assert "; make a new one: fleet certs renew" in edge.state().cause


async def attack(bus, place, edge, name, requests):
    """Try everything; the stop comes last, and shows that all before has come or was refused.

    A claim of long ago takes the robot from nobody, whoever makes it: the edge that has it keeps it.
    """
    robot, control = edge.process.robots["rex"], bus.control
    control.token(f"fleet/{name}/claims/{robot.twin}/1")
    control.token(f"fleet/elsewhere/claims/{robot.twin}/1")
    state = json.dumps({"name": "rex", "twin": robot.twin, "adapter": "toy", "edge": place.id, "stamp": 9e9})
    control.put(f"fleet/{place.id}/robots/rex/state", state.encode())
    command = f"fleet/{place.id}/robots/rex/command"
    answers = await asyncio.to_thread(lambda: list(control.request(command, COMMAND, timeout=1.0)))
    assert len(answers) == (name in COMMANDS)  # it cannot dance, and says so
    await drive(bus, place, robot, name, requests)
    control.put("fleet/*/stop", b"", urgent=True)
    await requests.until(lambda: robot.controller.latched)
    assert robot.state().reachable


async def drive(bus, place, robot, name, requests):
    """Send velocities; a program's move the robot, nobody else's do."""
    velocity = HeaderTemplate("application/json")
    moved = [f"drive:{0.2:g}"]

    def put():
        bus.reports.put(f"cw/{robot.twin}/data/commands/velocity", velocity.pack(b'{"linear_x": 0.2}'))
        return any(word in moved for word in place.words("rex"))

    if name in DRIVES:
        await requests.until(put)
        return
    for _ in range(5):
        assert not put()
