"""The unit of the agent of roll-outs: no device, one folder to write, and how systemd rates it."""

import subprocess
from pathlib import Path

import pytest

from fleet.errors import ConfigError
from fleet.service.agent_unit import AgentSpec, agent_spec_of, agent_text, agent_unit_name
from fleet.service.unit import ServiceSpec, unit_text

SPEC = AgentSpec("yard-1", Path("/etc/fleet/yard 1"), Path("/bin/sh"))


def settings(text):
    """Return the settings of a unit; of those that stand twice, the last."""
    return dict(line.split("=", 1) for line in text.splitlines() if "=" in line and not line.startswith("#"))


@pytest.fixture
def unit(tmp_path):
    path = tmp_path / SPEC.unit
    path.write_text(agent_text(SPEC))
    return path


def test_systemd_rates_its_exposure_at_most_3(unit, program):
    command = [program("systemd-analyze"), "security", "--offline=true", "--threshold=30", "--no-pager", unit]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "Overall exposure level" in result.stdout


def test_systemd_finds_nothing_wrong_in_it(unit, program):
    command = [program("systemd-analyze"), "verify", "--man=no", "--recursive-errors=no", unit]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (result.returncode, [line for line in result.stderr.splitlines() if SPEC.unit in line]) == (0, [])


def test_it_opens_no_device_and_writes_its_folder_alone():
    found = settings(agent_text(SPEC))
    assert (found["DevicePolicy"], found["PrivateDevices"]) == ("closed", "yes")
    assert "DeviceAllow" not in found
    assert found["ReadWritePaths"] == '"/etc/fleet/yard 1"'
    assert (found["User"], found["NoNewPrivileges"]) == ("fleet", "yes")
    assert found["ExecStart"] == '/bin/sh -P -m fleet rollout agent -- "/etc/fleet/yard 1"'


def test_it_starts_after_the_edge_and_runs_without_it():
    found = settings(agent_text(SPEC))
    assert "fleet-yard-1.service" in found["After"]
    assert not {"Requires", "BindsTo", "PartOf", "Requisite"} & set(found)
    assert (found["Restart"], found["RestartPreventExitStatus"]) == ("always", "3")


def test_it_reaches_the_edge_where_the_service_of_the_edge_is():
    edge = settings(
        unit_text(ServiceSpec("yard-1", Path("/etc/fleet/yard-1/current/fleet.yaml"), Path("/bin/sh")))
    )
    agent = settings(agent_text(SPEC))
    same = ("User", "Group", "RuntimeDirectory", "RuntimeDirectoryMode", "Environment", "EnvironmentFile")
    assert {name: agent[name] for name in same} == {name: edge[name] for name in same}


def test_an_edge_of_roll_outs_does_not_run_in_a_folder_that_a_roll_out_removes():
    spec = ServiceSpec("yard-1", Path("/etc/fleet/yard-1/current/fleet.yaml"), Path("/bin/sh"))
    assert settings(unit_text(spec))["WorkingDirectory"] == "/etc/fleet/yard-1"


def test_no_edge_has_a_unit_of_the_same_name():
    assert agent_unit_name("yard-1") == "fleet-yard-1.agent.service"  # no edge's id has a dot


def test_a_fleet_file_that_no_roll_out_brings_has_no_agent(tmp_path):
    with pytest.raises(ConfigError, match=r"comes from no roll-out: an agent needs FOLDER/current/"):
        agent_spec_of("yard-1", tmp_path / "fleet.yaml", Path("/bin/sh"))
    with pytest.raises(ConfigError, match=r"with FOLDER/rollout.yaml"):
        agent_spec_of("yard-1", tmp_path / "current" / "fleet.yaml", Path("/bin/sh"))


def test_a_folder_that_a_service_does_not_see_is_refused(tmp_path, monkeypatch):
    (tmp_path / "rollout.yaml").write_text("")
    file = tmp_path / "current" / "fleet.yaml"
    monkeypatch.setattr("fleet.service.unit.HIDDEN", ())
    assert agent_spec_of("yard-1", file, Path("/bin/sh")).folder == tmp_path
    monkeypatch.setattr("fleet.service.unit.HIDDEN", (tmp_path,))
    with pytest.raises(ConfigError, match="which a service does not see"):
        agent_spec_of("yard-1", file, Path("/bin/sh"))
