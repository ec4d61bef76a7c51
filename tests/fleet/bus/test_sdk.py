"""The published SDK's own bus reads what an edge reports."""

import queue

import psutil
import pytest
from cyberwave.data import DataBus
from cyberwave.data.config import get_backend

from fleet.bus.bus import open_edge
from fleet.bus.settings import BusSettings
from fleet.host.robot.report_queue import ReportQueue
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import PoseReport
from tests.tools.waiting import DEADLINE, wait_until

PROGRAM = """
import sys
from cyberwave.data import DataBus
from cyberwave.data.config import get_backend
backend = get_backend()
print("up", flush=True)
sys.stdin.read()
backend.close()
"""
TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"


@pytest.fixture
def places(directory, free_port):
    """Return where local programs join."""
    return {
        "socket": f"unixsock-stream/{directory}/yard.reports.sock",
        "loopback": f"tcp/127.0.0.1:{free_port}",
    }


@pytest.fixture
def edge(directory, opened, places):
    """Open the bus of an edge that also listens on loopback."""
    return opened(open_edge(BusSettings("yard", listen=(places["loopback"],)), directory))


@pytest.fixture
def outbox(edge):
    return ReportQueue(edge.reports)


@pytest.fixture(params=["client on the socket", "peer on the socket", "peer on loopback"])
def sdk(request, outbox, opened, places, monkeypatch):
    """Join as docs/how-to/bus.md says: by the environment, with nothing of ours."""
    mode, *_, place = request.param.split()
    monkeypatch.setenv("ZENOH_CONNECT", places[place])
    monkeypatch.setenv("ZENOH_MODE", mode)
    return opened(DataBus(opened(get_backend()), twin_uuid=TWIN))


def report(outbox, x):
    outbox.sender(TWIN)(PoseReport(1.0, Vector3(x, 2.0, 3.0), Quaternion()))
    outbox.flush()


def test_the_sdk_reads_the_last_pose_that_was_reported_before_it_came(outbox, sdk):
    report(outbox, 1.0)
    latest = wait_until("the pose is known", lambda: sdk.latest("position"))
    assert (latest["x"], latest["y"], latest["z"], latest["qw"]) == (1.0, 2.0, 3.0, 1.0)


def test_the_sdk_hears_every_pose(outbox, sdk):
    heard = queue.Queue()
    sdk.subscribe("position", heard.put)
    wait_until("a first one crosses", lambda: report(outbox, 0.0) or not heard.empty())
    report(outbox, 7.0)
    while heard.get(timeout=DEADLINE)["x"] != 7.0:
        pass


def test_the_sdk_drives_a_robot(edge, sdk):
    heard = queue.Queue()
    edge.reports.subscribe(f"cw/{TWIN}/data/commands/velocity", lambda _key, payload: heard.put(payload))

    def drive():
        sdk.publish("commands/velocity", {"linear": 0.25})

    wait_until("a velocity crosses", lambda: drive() or not heard.empty())
    assert b"0.25" in heard.get(timeout=DEADLINE)


def test_the_sdk_as_a_client_opens_no_port_that_others_could_join(outbox, directory, spawn, monkeypatch):
    monkeypatch.setenv("ZENOH_CONNECT", f"unixsock-stream/{directory}/yard.reports.sock")
    monkeypatch.setenv("ZENOH_MODE", "client")
    program = psutil.Process(spawn(PROGRAM).pid)
    assert program.net_connections(kind="tcp") == []
