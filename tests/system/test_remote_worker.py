"""A worker on another machine: all it shares with the edge is the bus, over a port."""

import json
import os
import subprocess
import sys
from datetime import UTC, datetime, timedelta

import pytest

from fleet.config.certificates import Identity, issue_pair, make_authority

PLUGIN = '''
import asyncio
from typing import Literal
from fleet import Adapter, AdapterConfig, Health, command

class ArmConfig(AdapterConfig):
    adapter: Literal["arm"]

class Arm(Adapter[ArmConfig]):
    Config = ArmConfig
    failsafe = "it moves nothing"

    async def connect(self):
        self.robot.log.info("the arm is there")

    async def stop(self, reason):
        pass

    def halt(self):
        pass

    @command("wave")
    async def wave(self):
        """Wave."""
'''


def certified(folder, role):
    """Make certificates for an edge and its worker; gives what ``bus`` says of them, by name."""
    now = datetime.now(UTC)
    authority = make_authority("site", now)
    (folder / "ca.pem").write_bytes(authority.certificate)
    for name in ("near", "far"):
        pair = issue_pair(authority, Identity(name, role, ("127.0.0.1",), now + timedelta(days=99)), now)
        (folder / f"{name}.pem").write_bytes(pair.certificate)
        (folder / f"{name}.key").write_bytes(pair.key)
    return {
        name: {
            "tls": {"root_ca": "ca.pem", "cert": f"{name}.pem", "key": f"{name}.key"},
            "access": {"far": "worker"},
        }
        for name in ("near", "far")
    }


@pytest.fixture(params=["tcp", "tls"])
def far_worker(request, tmp_path, fleet, free_port):
    """Run an edge, and its worker as on another machine: another runtime folder, the bus by a port alone."""
    endpoint = f"{request.param}/127.0.0.1:{free_port}"
    plain = {name: {"insecure": "local"} for name in ("near", "far")}
    proof = certified(tmp_path, "worker") if request.param == "tls" else plain
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "arm.py").write_text(PLUGIN)
    robot = {
        "name": "arm-1",
        "twin": "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b8a",
        "adapter": "arm",
        "worker": "far",
    }
    file = {
        "edge": {"id": f"near-{request.param}"},
        "plugins": ["plugins"],
        "remote_workers": ["far"],
        "robots": [robot],
    }
    for name, bus in (
        ("fleet.yaml", {"listen": [endpoint], **proof["near"]}),
        ("far.yaml", {"connect": [endpoint], **proof["far"]}),
    ):
        (tmp_path / name).write_text(json.dumps({**file, "bus": bus}))
    running = fleet("run", "--json", folder=tmp_path)
    running.line(f"edge near-{request.param} runs")
    elsewhere = os.environ | {"FLEET_RUNTIME_DIR": str(tmp_path)}
    command = [sys.executable, "-m", "fleet", "run", "--worker", "far", "far.yaml"]
    with subprocess.Popen(command, cwd=tmp_path, env=elsewhere, stderr=subprocess.DEVNULL) as worker:
        yield running
        worker.terminate()


def test_a_robot_in_a_worker_on_another_machine_is_commanded_and_stopped(far_worker):
    far_worker.robot("arm-1", "is well", lambda state: state["health"] == "ok")
    assert far_worker.call("send", "arm-1", "wave", "--wait").returncode == 0
    assert far_worker.call("stop", "arm-1").returncode == 0
    far_worker.robot("arm-1", "is stopped", lambda state: state.get("emergency_stop", False))
    assert far_worker.call("send", "arm-1", "wave").returncode == 5
