"""A roll-out to a real edge: bundle, store with accounts, agent and edge are what a user starts."""

import json
import os
import shutil
import signal
import subprocess
import sys
import uuid

import pytest

from fleet.rollout.accounts import server_accounts
from tests.tools.command_line import command_line, own_folders
from tests.tools.lease_service import lease_service
from tests.tools.waiting import wait_until

BUSY = """
import asyncio
from pathlib import Path
from typing import Literal

from fleet import Adapter, AdapterConfig, command


class BusyConfig(AdapterConfig):
    adapter: Literal["busy"]
    until: str
    colour: str = "red"


class Busy(Adapter[BusyConfig]):
    Config = BusyConfig
    failsafe = "it moves nothing"

    async def connect(self) -> None:
        pass

    @command("work", timeout=120.0)
    async def work(self):
        # Be taken, and work until a file is there.
        yield None
        while not Path(self.config.until).exists():
            await asyncio.sleep(0.05)

    async def stop(self, reason: str) -> None:
        pass

    def halt(self) -> None:
        pass
"""
PASSWORDS = {"operator": "of-the-operator", "yard": "of-the-edge"}


def with_passwords(text, passwords):
    """Give the accounts of a server passwords, in the place of certificates."""
    for user, password in passwords.items():
        text = text.replace(f'"user":"{user}"', f'"user":"{user}","password":"{password}"')
    return text


class Site:
    """Where bundles are made, and the folder of one edge."""

    def __init__(self, folder, port, runtime):
        self.source, self.edge, self._runtime = folder / "source", folder / "edge", runtime
        (self.source / "plugins").mkdir(parents=True)
        (self.source / "plugins" / "busy.py").write_text(BUSY)
        self.rests = folder / "rests"
        for path in (self.source, *self.source.rglob("*")):
            path.chmod(0o755)
        self.edge.mkdir()
        self.id = "yard"
        self.twin = str(uuid.uuid4())
        self.done(self.call("bundle", "key", str(self.source / "site")))
        shutil.copy(self.source / "site.pub", self.edge)
        store = {"servers": [f"nats://127.0.0.1:{port}"], "trust": ["site.pub"]}
        self.write(self.source / "rollout.yaml", store | self.account("operator"))
        self.write(
            self.edge / "rollout.yaml", store | self.account("yard") | {"edge": "yard", "look_every": 0.5}
        )

    def begin(self, *arguments):
        """Start a command that goes on for a while."""
        command = [sys.executable, "-m", "fleet", *arguments]
        pipe, environment = subprocess.PIPE, os.environ | own_folders(self._runtime)
        return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=environment)

    def call(self, *arguments):
        """Run a command to its end."""
        return command_line(self._runtime, *arguments)

    def ended(self, process):
        """Return how a command ended that was started."""
        try:
            out, err = process.communicate(timeout=90.0)
        finally:
            process.kill()
        return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    def account(self, user):
        return {"user": user, "password": PASSWORDS[user]}

    def write(self, path, data):
        path.write_text(json.dumps(data))

    def done(self, ended):
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    def bundle(self, version, **fields):
        """Make a bundle in which the robot has further fields; return its file."""
        robot = {"name": "rex", "twin": self.twin, "adapter": "busy", "until": str(self.rests)}
        robot |= {"worker": "main", **fields}
        config = {"edge": {"id": self.id}, "plugins": ["plugins"], "robots": [robot]}
        self.write(self.source / "fleet.yaml", config)
        into = self.source / f"{version}-{uuid.uuid4().hex[:6]}.bundle"
        key, file = str(self.source / "site.key"), str(self.source / "fleet.yaml")
        self.done(self.call("bundle", "make", file, "--key", key, "--version", str(version), "-o", str(into)))
        return str(into)

    def status(self):
        """Return what the edge reports of the roll-out, as the operator is shown it."""
        result = self.call("rollout", "status", "--store", str(self.source / "rollout.yaml"), "--json")
        observed = json.loads(result.stdout).get("observed", {}) if result.returncode == 0 else {}
        return observed.get("yard", {"stage": "", "why": result.stderr})

    def roll_out(self, bundle, *options):
        """Roll a bundle out; return the exit code and what the edge reports at its end."""
        store = str(self.source / "rollout.yaml")
        ended = self.call("apply", "--fleet", bundle, "--store", store, "--settle", "5", "--json", *options)
        return ended.returncode, json.loads(ended.stdout)["observed"].get("yard"), ended.stderr


@pytest.fixture
def site(tmp_path, runtime):
    accounts = with_passwords(server_accounts(["yard"], ["operator"]), PASSWORDS)
    store = tmp_path / "store"
    store.mkdir()
    with lease_service(store, accounts) as port:
        yield Site(tmp_path, port, runtime)


@pytest.fixture
def running(site, fleet):
    """Run the edge with its first bundle, and its agent."""
    site.done(site.call("bundle", "install", site.bundle(1), "--into", str(site.edge)))
    edge = fleet("run", "--json", str(site.edge / "current" / "fleet.yaml"))
    edge.robot("rex", "is ready", lambda state: state["health"] == "ok")
    return edge, fleet("rollout", "agent", str(site.edge))


def test_a_bundle_reaches_a_running_edge_and_an_older_one_never_does(site, running):
    edge, agent = running
    code, report, errors = site.roll_out(site.bundle(2, limits={"speed": 0.5}))
    assert (code, report["stage"], report["lines"]) == (0, "done", ["rex: settings only: done"]), errors

    code, report, errors = site.roll_out(site.bundle(3, limits={"speed": -1}))
    assert (code, report["stage"]) == (7, "failed"), errors
    assert "must be more than 0" in report["why"]

    code, report, errors = site.roll_out(site.bundle(1, limits={"speed": 9.0}))
    assert (code, report["stage"]) == (7, "refused"), errors
    assert "version 1 is not newer than version 2" in report["why"]

    speed = json.loads((site.edge / "current" / "fleet.yaml").read_text())["robots"][0]["limits"]["speed"]
    assert speed == 0.5
    assert agent.end() == 0
    wait_until("the edge still runs", lambda: edge.process.poll() is None)


def test_a_robot_in_motion_is_not_rebuilt_and_who_detaches_comes_back(site, running):
    edge, _ = running
    store = str(site.source / "rollout.yaml")
    working = site.begin("send", "rex", "work", "--json", "--wait")
    edge.robot("rex", "works", lambda state: "work" in state.get("activity", ""))
    rolling = site.begin("apply", "--fleet", site.bundle(2, colour="green"), "--store", store)
    try:
        waiting = wait_until(
            "the edge waits", lambda: (found := site.status())["stage"] == "waiting" and found, within=60.0
        )
        assert "rex is commanded" in waiting["why"]
        rolling.send_signal(signal.SIGINT)
    finally:
        detached = site.ended(rolling)
        site.rests.touch()
    assert (detached.returncode, "detached" in detached.stderr) == (130, True)
    ended = site.call("rollout", "resume", "--store", store, "--json")
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout)["observed"]["yard"]["lines"] == ["rex: rebuilt: done"]
    assert site.ended(working).returncode == 0
