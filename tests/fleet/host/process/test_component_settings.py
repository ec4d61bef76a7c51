import socket

import pytest

from fleet.config.edge_section import EdgeConfig
from fleet.config.schema import BusConfig, CloudConfig, FleetConfig
from fleet.host.process.component_settings import (
    bridge_rules,
    bus_settings,
    cloud_settings,
    settle_time_beside,
    topics,
    worker_of,
)
from fleet.host.process.twin_claims import SETTLE
from fleet.plugins.registry import Plugin
from fleet.robot_config import AdapterConfig

TWIN = "6f0c9a1e-0000-4000-8000-000000000001"
OTHER = "6f0c9a1e-0000-4000-8000-000000000002"


def fleet(**bus):
    return FleetConfig(edge=EdgeConfig(id="yard"), bus=BusConfig(**bus), robots=())


def cloud(**fields):
    return CloudConfig(host="127.0.0.1", tls=False, **fields)


def robot(**fields):
    return AdapterConfig(name="rex", twin=TWIN, **fields)


def test_an_edge_waits_for_its_twins_where_another_edge_runs_on_this_computer(tmp_path):
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(tmp_path / "orchard.control.sock"))
        other.listen()
        assert settle_time_beside("yard", tmp_path) == SETTLE
        assert settle_time_beside("orchard", tmp_path) == 0.0
    assert settle_time_beside("yard", tmp_path) == 0.0


@pytest.mark.parametrize(
    ("origin", "worker", "expected"),
    [
        ("fleet_mavlink:MavlinkAdapter", None, ""),
        ("fleet_mavlink:MavlinkAdapter", "arm", "arm"),
        ("fleet_mavlink:MavlinkAdapter", "main", ""),
        ("/plugins/toy.py", None, "rex"),
        ("/plugins/toy.py", "arm", "arm"),
        ("/plugins/toy.py", "main", ""),
    ],
)
def test_a_drop_in_file_has_a_process_of_its_own_unless_it_is_trusted(origin, worker, expected):
    assert worker_of(robot(worker=worker), Plugin("toy", origin)) == expected


def test_a_bus_that_says_nothing_opens_its_sockets_alone():
    settings = bus_settings(fleet())
    assert (settings.edge, settings.mode, settings.listen, settings.connect) == ("yard", "peer", (), ())
    assert (settings.user, settings.password, settings.scouting) == (None, None, False)


def test_what_the_bus_says_is_handed_on():
    settings = bus_settings(
        fleet(
            listen=("tcp/0.0.0.0:7447",),
            connect=("tcp/hub:7447",),
            user="anna",
            password="secret",
            scouting=True,
        )
    )
    assert settings.listen == ("tcp/0.0.0.0:7447",)
    assert settings.connect == ("tcp/hub:7447",)
    assert (settings.user, settings.password, settings.scouting) == ("anna", "secret", True)


def test_certificates_are_handed_on_as_paths(tmp_path):
    for name in ("ca", "cert", "key"):
        (tmp_path / name).write_text("")
    paths = {"root_ca": tmp_path / "ca", "cert": tmp_path / "cert", "key": tmp_path / "key"}
    tls = bus_settings(fleet(listen=("tls/0.0.0.0:7447",), tls=paths)).tls
    assert (tls.root_ca, tls.certificate, tls.key) == tuple(str(tmp_path / n) for n in ("ca", "cert", "key"))
    assert (tls.mutual, tls.verify_name) == (True, True)


def test_a_token_becomes_the_login_that_the_broker_expects():
    settings = cloud_settings(cloud(token="cw_abc"), simulated=False)
    assert settings.username.startswith("cwh_")
    assert settings.password == "cw_abc"
    assert settings.client_id.startswith("fleet_live_")


def test_a_broker_account_stays_as_it_is():
    settings = cloud_settings(cloud(username="anna", password="secret"), simulated=True)
    assert (settings.username, settings.password) == ("anna", "secret")
    assert settings.client_id.startswith("fleet_sim_")


def test_without_credentials_the_edge_is_anonymous():
    settings = cloud_settings(cloud(), simulated=False)
    assert (settings.username, settings.password, settings.ca_file) == (None, None, None)


def test_no_two_edges_have_the_same_client_id():
    assert len({cloud_settings(cloud(), simulated=False).client_id for _ in range(50)}) == 50


def test_no_text_of_the_settings_holds_the_password():
    assert "secret" not in repr(cloud_settings(cloud(username="a", password="secret"), simulated=False))


@pytest.mark.parametrize(
    ("given", "environ", "prefix"),
    [
        ({}, {}, ""),
        ({}, {"CYBERWAVE_ENVIRONMENT": "staging"}, "staging"),
        ({}, {"CYBERWAVE_ENVIRONMENT": "production"}, ""),
        ({"prefix": "mine/"}, {"CYBERWAVE_ENVIRONMENT": "staging"}, "mine/"),
        ({"prefix": ""}, {"CYBERWAVE_ENVIRONMENT": "staging"}, ""),
    ],
)
def test_the_prefix_of_the_file_wins_even_when_it_is_empty(given, environ, prefix):
    assert topics(cloud(**given), environ).prefix == prefix


def test_a_robot_that_does_not_listen_to_a_topic_is_not_asked_on_it_though_it_says_nothing_else():
    deaf = robot(inbound={"motion/command": {"on": False}})
    usual = AdapterConfig(name="kestrel", twin=OTHER)
    books = bridge_rules(cloud(), [deaf, usual]).twins
    assert "motion/command" not in books[TWIN].inward
    assert "motion/command" in books[OTHER].inward


def test_a_robot_s_own_rate_counts_for_it_alone():
    slow = robot(rules={"position": {"rate": 2}})
    usual = AdapterConfig(name="kestrel", twin=OTHER)
    books = bridge_rules(cloud(), [slow, usual]).twins
    assert (books[TWIN].outward["position"].max_rate, books[OTHER].outward["position"].max_rate) == (2, 20)
