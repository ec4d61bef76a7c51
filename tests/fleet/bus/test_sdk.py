"""The published SDK's own bus reads what an edge reports."""

import queue

import pytest
from cyberwave.data import DataBus
from cyberwave.data.zenoh_backend import ZenohBackend

from fleet.bus.session import open_edge
from fleet.bus.settings import BusSettings
from fleet.host.outbox import Outbox
from fleet.model.geometry import Quaternion, Vector3
from fleet.model.report import PoseReport
from fleet.testing.waiting import DEADLINE, wait_until

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"


@pytest.fixture
def outbox(directory, opened, free_port):
    return Outbox(
        opened(open_edge(BusSettings("yard", listen=(f"tcp/127.0.0.1:{free_port}",)), directory)).reports
    )


@pytest.fixture
def sdk(outbox, opened, free_port):
    backend = opened(ZenohBackend(connect=[f"tcp/127.0.0.1:{free_port}"]))
    return opened(DataBus(backend, twin_uuid=TWIN))


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
