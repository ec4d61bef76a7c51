"""The bridge to the cloud is built of fleet.yaml: its session, the edges it gives way to, and its spool."""

import json
from types import SimpleNamespace

import pytest

from fleet.cloud.values import CloudMessage
from fleet.config.schema import FleetConfig
from fleet.errors import CloudError
from fleet.host.edge.bridge_to_cloud import bridge_of
from fleet.robot_config import AdapterConfig
from fleet.testing.clock import ManualClock
from fleet.wire.rules import WORKFLOW_RUN

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"
OTHER = "6f0c9a1e-0000-4000-8000-000000000002"
CLOUD = {"host": "127.0.0.1", "tls": False}


def port(twin=TWIN, source_type="edge"):
    return SimpleNamespace(name="rex", twin=twin, source_type=source_type, legacy_status=False)


class Built:
    """A bridge of a fleet file, and the claims that it passes on."""

    def __init__(self, folder, ports=None, handlers=(), **sections):
        edge = {"id": "yard", "spool": {"path": str(folder / "state")}}
        robots = [AdapterConfig(name=f"rex{twin[-1]}", twin=twin) for twin in (TWIN, OTHER)]
        config = FleetConfig(**({"edge": edge, "robots": (), "cloud": CLOUD} | sections))
        config = config.model_copy(update={"robots": tuple(robots)})
        self.claims = []
        self.bridge = bridge_of(
            config,
            {TWIN: port()} if ports is None else {each.twin: each for each in ports},
            put=lambda *_: None,
            alive=lambda _name: True,
            claimed=lambda twin, edge: self.claims.append((twin, edge)),
            clock=ManualClock(),
            handlers=dict(handlers),
        )

    def receive(self, channel, message):
        """Let a message on a channel of the twin arrive."""
        self.dispatch(f"cyberwave/twin/{TWIN}/{channel}", message)

    def dispatch(self, topic, message):
        self.bridge.downlink.arrived([CloudMessage(topic, json.dumps(message).encode())])
        self.bridge.downlink.dispatch()

    def beat(self, edge):
        """Let two heartbeats of an edge arrive, which has run for an hour."""
        for _ in range(2):
            self.receive("edge_health", {"type": "edge_health", "edge_id": edge, "uptime_seconds": 3600.0})


@pytest.fixture
def build(tmp_path):
    built = []

    def build(**options):
        built.append(Built(tmp_path, **options))
        return built[-1]

    yield build
    for each in built:
        if each.bridge is not None:
            each.bridge.client.close()


def test_an_edge_without_a_cloud_has_no_bridge(build):
    assert build(cloud=None).bridge is None


SOURCES = [
    (("edge",), "fleet_live_"),
    (("sim",), "fleet_sim_"),
    (("sim", "sim"), "fleet_sim_"),
    (("edge", "sim"), "fleet_live_"),
]


@pytest.mark.parametrize(("sources", "begins"), SOURCES)
def test_only_an_edge_whose_robots_are_all_simulated_is_a_simulation_to_the_cloud(build, sources, begins):
    ports = [port(twin, source) for twin, source in zip((TWIN, OTHER), sources, strict=False)]
    assert build(ports=ports).bridge.session.startswith(begins)


def test_an_edge_with_an_older_claim_is_told_but_not_the_other_edge_of_a_pair_or_an_ignored_one(build):
    cloud = CLOUD | {"ignore_edges": ["attic"]}
    built = build(cloud=cloud, pair=("yard", "barn"))
    for edge in ("barn", "attic", "yard-2"):
        built.beat(edge)
    assert built.claims == [(TWIN, "yard-2")]


def test_an_edge_without_a_pair_gives_way_to_any_edge(build):
    built = build()
    built.beat("barn")
    assert built.claims == [(TWIN, "barn")]


def test_the_requests_to_the_edge_itself_go_to_their_handlers(build):
    flow, taken = "00000000-0000-4000-8000-000000000009", []
    cloud = CLOUD | {"workflows": {flow: {"mission": "patrol"}}}
    handlers = {WORKFLOW_RUN: lambda topic, message: taken.append((topic.twin, message.payload))}
    build(cloud=cloud, handlers=handlers).dispatch(f"cyberwave/workflow/{flow}/run", {"x": 1})
    assert taken == [(flow, b'{"x": 1}')]


def test_durable_messages_wait_in_the_folder_of_the_edge(build, tmp_path):
    build().bridge.client.close()
    assert list((tmp_path / "state").iterdir())


def test_a_file_that_is_no_certificate_is_an_error_of_the_cloud(build, tmp_path):
    (tmp_path / "ca.pem").write_text("no certificate")
    with pytest.raises(CloudError, match=r"ca\.pem"):
        build(cloud={"host": "127.0.0.1", "ca_file": str(tmp_path / "ca.pem")})
