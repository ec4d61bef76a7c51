"""People with certificates of their own command the robots of an edge from another computer, over TLS."""

import asyncio
import json
import tempfile

import pytest

from fleet.cli.main import main
from fleet.client.edges import Edges
from fleet.history.event_filter import EventFilter
from fleet.history.reader import read

HERE = {"worker": "main"}
PATROL = {"version": 1, "roles": {"eye": {"from": "rex"}}, "steps": [{"id": "go", "do": {"eye": "walk"}}]}
NEEDS_OPERATE = "it needs the permission operate; yours is view"
ROLES = {"anna": "operate", "vic": "view"}


class Site:
    """A running edge that listens on TLS, and the computers of people."""

    def __init__(self, place, edge, capsys):
        self.place, self.edge, self.capsys = place, edge, capsys

    async def does(self, name, *words):
        """Run a command on somebody's computer; returns exit code and output."""
        code = await asyncio.to_thread(main, [*words, "-f", f"{name}.yaml"])
        captured = self.capsys.readouterr()
        return code, captured.out + captured.err

    def requested(self):
        """Return what the history has of who asked, with whether the name is proven."""
        history = self.edge.process.history
        found = [*read(history.folder, EventFilter((), 0.0, 90)), *history.waiting()]
        return [(each.text, each.asker.name, each.asker.proven) for each in found if each.asker]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Give a folder in which commands are run."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
async def site(yard, run_edge, folder, free_port, request):
    capsys, monkeypatch, requests = map(request.getfixturevalue, ("capsys", "monkeypatch", "requests"))
    assert main(["certs", "init", "site"]) == 0
    place = yard(rex=HERE, max=HERE)
    for name, role in {place.id: "edge", **dict.fromkeys(ROLES, "person")}.items():
        assert main(["certs", "issue", name, "--as", role]) == 0
    assert "bus.access: {vic: operate}, or view, or admin" in capsys.readouterr().err

    def tls(name):
        return {"root_ca": "certs/ca.pem", "cert": f"certs/{name}.pem", "key": f"certs/{name}.key"}

    there = f"tls/127.0.0.1:{free_port}"
    place.change(bus={"listen": [there], "access": ROLES, "tls": tls(place.id)}, missions={"patrol": PATROL})
    for name in ROLES:
        bus = {"mode": "client", "connect": [there], "tls": tls(name)}
        (folder / f"{name}.yaml").write_text(json.dumps({"edge": {"id": f"of-{name}"}, "bus": bus}))
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: all(state.health == "ok" for state in edge.states()))
        with tempfile.TemporaryDirectory() as runtime:
            monkeypatch.setenv("FLEET_RUNTIME_DIR", runtime)  # of another computer
            yield Site(place, edge, capsys)


async def test_who_may_operate_commands_and_the_history_has_the_name_of_the_certificate(site, requests):
    code, output = await site.does("anna", "send", "rex", "walk", "--wait")
    assert (code, "walk done" in output) == (0, True), output
    await requests.until(lambda: ("walk accepted", "anna", True) in site.requested())
    code, output = await site.does("anna", "history", "rex")
    assert (code, "anna (proven, bus)" in output) == (0, True), output


async def test_who_may_view_sees_all_stops_all_and_is_refused_the_rest_with_words(site, requests):
    code, output = await site.does("vic", "ps")
    assert (code, "rex" in output) == (0, True), output
    code, output = await site.does("vic", "send", "rex", "walk")
    assert (code, NEEDS_OPERATE in output) == (5, True), output
    code, output = await site.does("vic", "mission", "run", "patrol")
    assert (code, NEEDS_OPERATE in output) == (5, True), output
    assert site.place.words("rex") == ["run"]
    await requests.until(lambda: (f"walk refused: {NEEDS_OPERATE}", "vic", True) in site.requested())
    code, output = await site.does("vic", "send", "rex", "stop")
    assert code == 0, output
    await requests.until(lambda: ("stop asked", "vic", True) in site.requested())
    code, output = await site.does("vic", "stop", "rex")
    assert code == 0, output
    await requests.until(lambda: next(s for s in site.edge.states() if s.name == "rex").emergency_stop)
    code, output = await site.does("vic", "release", "rex")
    assert (code, NEEDS_OPERATE in output) == (5, True), output


async def test_missions_and_common_starts_are_for_who_may_operate(site, requests):
    code, output = await site.does("anna", "mission", "run", "patrol")
    assert code == 0, output
    await requests.until(lambda: ("mission patrol completed", "anna", True) in site.requested())
    code, output = await site.does("anna", "send", "max", "walk", "--at", "+2s", "--wait")
    assert code == 0, output
    code, output = await site.does("vic", "send", "max", "walk", "--at", "+2s")
    assert code != 0, output
    assert site.place.words("max").count("walk") == 1


async def test_nobody_asks_in_the_name_of_another(site):
    def forge():
        with Edges.reach("vic.yaml") as edges:
            (session,) = edges.sessions
            assert session.person == "vic"
            session.person = "anna"
            robots, walk = edges.named("rex"), b'{"command": "walk"}'
            return list(edges.command(*robots, walk, kind="command", wait=False, timeout=1.0))

    assert await asyncio.to_thread(forge) == []
    assert site.place.words("rex") == ["run"]
