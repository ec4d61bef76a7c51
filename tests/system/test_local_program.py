"""A program of Cyberwave's SDK on the edge's computer joins as docs/how-to/bus.md says, and drives a base."""

import json

import psutil
import pytest
from cyberwave.data import DataBus
from cyberwave.data.config import get_backend

from tests.tools.waiting import wait_until

TWIN = "6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7b8d"


@pytest.fixture
def base(fleet, bases, tmp_path):
    """Run a fleet of one base, without a cloud; gives the edge and what the base truly does."""
    port = bases.add("waveshare-beast")
    robot = {"name": "rover", "twin": TWIN, "adapter": "ugv", "profile": "waveshare-beast", "link": port.url}
    (tmp_path / "fleet.yaml").write_text(json.dumps({"edge": {"id": "yard"}, "robots": [robot]}))
    running = fleet("run", "--json", folder=tmp_path)
    running.robot("rover", "is well", lambda state: state["health"] == "ok")
    return running, port.board.physics


@pytest.fixture
def bus(base, runtime, monkeypatch):
    """Join by the environment alone."""
    monkeypatch.setenv("ZENOH_CONNECT", f"unixsock-stream/{runtime}/yard.reports.sock")
    monkeypatch.setenv("ZENOH_MODE", "client")
    backend = get_backend()
    yield DataBus(backend, twin_uuid=TWIN)
    backend.close()


def test_it_drives_the_base_and_hears_it_without_any_port(base, bus):
    running, physics = base
    wait_until("the base is heard", lambda: bus.latest("position"))

    def drive():
        bus.publish("commands/velocity", {"linear_x": 0.2})
        return physics.x > 0.1

    wait_until("the base has moved", drive)
    wait_until("it stands when nothing is said", lambda: physics.speeds[0] == pytest.approx(0.0, abs=0.01))
    family = [psutil.Process(running.process.pid)]
    family += family[0].children(recursive=True)
    assert [place for process in family for place in process.net_connections(kind="tcp")] == []
    assert running.call("stop", "rover").returncode == 0
