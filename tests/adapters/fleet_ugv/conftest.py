import contextlib
import uuid

import pytest

from fleet.link.memory import MemoryRobot
from fleet_ugv import UgvConfig
from fleet_ugv.sim.spec import BaseSpec, board_of
from tests.adapters.fleet_ugv.benches import Bench

TWIN = "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f"


def config_of(profile="waveshare-beast", link="memory:beast", **fields):
    basics = {"name": "beast", "twin": TWIN, "adapter": "ugv"}
    return UgvConfig(**basics | {"profile": profile, "link": link} | fields)


@pytest.fixture
def make_config():
    return config_of


@pytest.fixture
async def make_bench(make_config, request):
    async with contextlib.AsyncExitStack() as stack:

        def make(profile="waveshare-beast", faults=None, firmware="ros", **fields):
            name = request.node.name.replace("[", ".").rstrip("]")
            machine = stack.enter_context(MemoryRobot(name))
            board = board_of(BaseSpec(profile, faults=faults or {}, firmware=firmware))
            bench = Bench(
                make_config(profile, f"memory:{name}", twin=str(uuid.uuid4()), **fields), machine, board
            )
            stack.push_async_callback(bench.end)
            return bench

        yield make


@pytest.fixture
async def bench(make_bench):
    return await make_bench().ready()
