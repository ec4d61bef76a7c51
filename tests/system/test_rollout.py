"""A roll-out to a real edge: bundle, store with accounts, agent and edge are what a user starts."""

import json
import os
import shutil
import subprocess
import sys
import uuid

import pytest

from fleet.rollout.accounts import server_users
from fleet.testing.waiting import wait_until
from tests.tools.asker import PUPPETS
from tests.tools.lease_service import lease_service

PASSWORDS = {"operator": "of-the-operator", "yard": "of-the-edge"}


def with_passwords(text, passwords):
    """Give the accounts of a server passwords, in the place of certificates."""
    for user, password in passwords.items():
        text = text.replace(f'"user":"{user}"', f'"user":"{user}","password":"{password}"')
    return text


class Site:
    """Where bundles are made, and the folder of one edge."""

    def __init__(self, folder, port, call):
        self.source, self.edge, self.call = folder / "source", folder / "edge", call
        shutil.copytree(PUPPETS, self.source / "plugins")
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

    def account(self, user):
        return {"user": user, "password": PASSWORDS[user]}

    def write(self, path, data):
        path.write_text(json.dumps(data))

    def done(self, ended):
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    def bundle(self, version, **fields):
        """Make a bundle in which the robot has further fields; return its file."""
        robot = {"name": "rex", "twin": self.twin, "adapter": "puppet", "worker": "main", "rate": 0}
        config = {"edge": {"id": self.id}, "plugins": ["plugins"], "robots": [robot | fields]}
        self.write(self.source / "fleet.yaml", config)
        into = self.source / f"{version}-{uuid.uuid4().hex[:6]}.bundle"
        key, file = str(self.source / "site.key"), str(self.source / "fleet.yaml")
        self.done(self.call("bundle", "make", file, "--key", key, "--version", str(version), "-o", str(into)))
        return str(into)

    def roll_out(self, bundle, *options):
        """Roll a bundle out; return the exit code and what the edge reports at its end."""
        store = str(self.source / "rollout.yaml")
        ended = self.call(
            "apply", "--fleet", bundle, "--store", store, "--settle", "5", "--json", *options, within=120
        )
        return ended.returncode, json.loads(ended.stdout)["observed"].get("yard"), ended.stderr


@pytest.fixture
def site(tmp_path, runtime):
    def call(*arguments, within=90.0):
        own = {"FLEET_RUNTIME_DIR": runtime, "XDG_STATE_HOME": f"{runtime}/state"}
        command = [sys.executable, "-m", "fleet", *arguments]
        return subprocess.run(
            command, capture_output=True, text=True, env=os.environ | own, timeout=within, check=False
        )

    accounts = with_passwords(server_users(["yard"], ["operator"]), PASSWORDS)
    store = tmp_path / "store"
    store.mkdir()
    with lease_service(store, accounts) as port:
        yield Site(tmp_path, port, call)


def test_a_bundle_reaches_a_running_edge_and_an_older_one_never_does(site, fleet):
    site.done(site.call("bundle", "install", site.bundle(1), "--into", str(site.edge)))
    edge = fleet("run", "--json", str(site.edge / "current" / "fleet.yaml"))
    edge.robot("rex", "is ready", lambda state: state["health"] == "ok")
    agent = fleet("rollout", "agent", str(site.edge))

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
