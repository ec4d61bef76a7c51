"""``fleet service``: what it prints, writes below a root, and refuses."""

import sys
from pathlib import Path

import pytest

import fleet.cli.service as command
from fleet.config.edge_id import EDGE_ID
from fleet.rollout.signature import new_key

TEXT = """\
edge: {id: yard-1}
robots:
  - name: kestrel
    twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
    adapter: mavlink
    link: serial:/dev/ttyS0?baud=57600
    system_id: 1
"""


@pytest.fixture
def installable(place, monkeypatch):
    """Write a fleet file whose interpreter and folder a service would see."""
    (place / "fleet.yaml").write_text(TEXT)
    monkeypatch.setattr("fleet.service.unit.HIDDEN", ())
    monkeypatch.setattr(sys, "executable", "/opt/fleet/bin/python")
    return place


def test_the_files_are_printed_and_none_is_written(fleet, installable):
    result = fleet("service", "install", "--print", "--json")
    assert result.code == 0
    assert set(result.json["files"]) == {
        "/etc/systemd/system/fleet-yard-1.service",
        "/etc/sysusers.d/fleet.conf",
        "/etc/udev/rules.d/90-fleet-yard-1.rules",
    }


def test_an_image_gets_the_files_below_its_root(fleet, installable):
    result = fleet("service", "install", "--root", "image")
    assert result.code == 0, result.err
    unit = installable / "image/etc/systemd/system/fleet-yard-1.service"
    assert f"ExecStart=/opt/fleet/bin/python -P -m fleet run -- {installable}/fleet.yaml" in unit.read_text()
    assert fleet("service", "uninstall", "--root", "image").code == 0
    assert not unit.exists()


def test_the_unit_of_a_pair_says_which_edge_it_is(fleet, installable, monkeypatch):
    monkeypatch.setenv(EDGE_ID, "")  # put back afterwards
    text = TEXT.replace(
        "edge: {id: yard-1}", "pair: [yard-1, yard-2]\nlease: {servers: [nats://localhost:1]}"
    )
    (installable / "fleet.yaml").write_text(
        text.replace("serial:/dev/ttyS0?baud=57600", "udpin:0.0.0.0:14550")
    )
    refused = fleet("service", "install", "--root", "image")
    assert (refused.code, "--edge-id yard-1 or yard-2" in refused.err) == (3, True)
    result = fleet("service", "install", "--root", "image", "--edge-id", "yard-2")
    assert result.code == 0, result.err
    unit = installable / "image/etc/systemd/system/fleet-yard-2.service"
    assert f"-m fleet run --edge-id yard-2 -- {installable}/fleet.yaml" in unit.read_text()
    assert fleet("service", "uninstall", "--root", "image", "--edge-id", "yard-2").code == 0
    assert not unit.exists()


def test_who_is_not_root_is_refused_with_that_reason(fleet, installable, monkeypatch):
    monkeypatch.setattr(command, "is_root", lambda: False)
    result = fleet("service", "install")
    assert (result.code, "sudo fleet service install" in result.err) == (1, True)


def test_a_fleet_file_in_a_home_is_refused(fleet, installable, monkeypatch):
    monkeypatch.setattr("fleet.service.unit.HIDDEN", (Path(installable),))
    result = fleet("service", "install", "--root", "image")
    assert (result.code, "keep the fleet file in /etc/fleet" in result.err) == (3, True)


@pytest.mark.parametrize(
    ("state", "code"), [("active", 0), ("activating", 4), ("failed", 4), ("inactive", 4)]
)
def test_the_status_has_an_exit_code_for_a_service_that_does_not_run(
    fleet, installable, monkeypatch, state, code
):
    properties = f"LoadState=loaded\nActiveState={state}\nStatusText=the edge is running\n"
    monkeypatch.setattr(command, "run_program", lambda _: properties)
    result = fleet("service", "status")
    assert (result.code, "the edge is running" in result.out) == (code, True)


def test_a_service_that_is_not_installed_is_reported_with_the_command(fleet, installable, monkeypatch):
    monkeypatch.setattr(command, "run_program", lambda _: "LoadState=not-found\n")
    result = fleet("service", "status")
    assert (result.code, "fleet service install" in result.err) == (4, True)


def test_the_log_is_the_journal_of_the_unit(fleet, installable, monkeypatch):
    ran = []
    monkeypatch.setattr(command.shutil, "which", lambda _: "/usr/bin/journalctl")
    monkeypatch.setattr(command.os, "execv", lambda program, words: ran.append((program, words)))
    fleet("service", "logs", "-f", "-n", "5", "--robot", "kestrel")
    words = ["--unit=fleet-yard-1.service", "--lines=5", "--no-pager", "--follow", "FLEET_ROBOT=kestrel"]
    assert ran == [("/usr/bin/journalctl", ["/usr/bin/journalctl", *words])]


@pytest.fixture
def rolled_out(installable):
    """Put the fleet file where roll-outs do; gives the folder of the agent."""
    folder = installable / "yard-1"
    (folder / "versions" / "a").mkdir(parents=True)
    (folder / "versions" / "a" / "fleet.yaml").write_text(TEXT)
    (folder / "current").symlink_to(Path("versions", "a"))
    pair = new_key()
    (folder / "site.pub").write_bytes(pair.public.pem())
    (folder / "rollout.yaml").write_text(
        "edge: yard-1\nservers: ['tls://nats.example.com:4222']\ntrust: [site.pub]\n"
    )
    return folder


def test_the_agent_of_roll_outs_is_installed_with_the_edge_and_removed_with_it(fleet, rolled_out):
    file = "yard-1/current/fleet.yaml"
    result = fleet("service", "install", file, "--agent", "--root", "image", "--json")
    assert (result.code, result.json["agent"]) == (0, "fleet-yard-1.agent.service"), result.err
    unit = rolled_out.parent / "image/etc/systemd/system/fleet-yard-1.agent.service"
    assert f"-m fleet rollout agent -- {rolled_out}\n" in unit.read_text()
    assert fleet("service", "uninstall", file, "--root", "image").code == 0
    assert not unit.exists()


def test_an_agent_for_another_edge_or_without_roll_outs_is_refused(fleet, rolled_out):
    result = fleet("service", "install", "--agent", "--root", "image")
    assert (result.code, "comes from no roll-out" in result.err) == (3, True)
    text = (rolled_out / "rollout.yaml").read_text()
    (rolled_out / "rollout.yaml").write_text(text.replace("yard-1", "yard-2"))
    result = fleet("service", "install", "yard-1/current/fleet.yaml", "--agent", "--root", "image")
    assert (result.code, "is for edge yard-2, not yard-1" in result.err) == (3, True)


@pytest.mark.parametrize(("state", "code"), [("active", 0), ("failed", 4)])
def test_the_status_has_the_agent_where_there_is_one(fleet, installable, monkeypatch, state, code):
    def run_systemctl(command):
        return f"LoadState=loaded\nActiveState={state if 'agent' in command[-1] else 'active'}\n"

    monkeypatch.setattr(command, "run_program", run_systemctl)
    result = fleet("service", "status")
    assert (result.code, f"fleet-yard-1.agent.service: {state}" in result.out) == (code, True)


def test_the_log_of_the_agent_is_that_of_its_unit(fleet, installable, monkeypatch):
    ran = []
    monkeypatch.setattr(command.shutil, "which", lambda _: "/usr/bin/journalctl")
    monkeypatch.setattr(command.os, "execv", lambda _program, words: ran.append(words))
    fleet("service", "logs", "--agent")
    assert "--unit=fleet-yard-1.agent.service" in ran[0]
