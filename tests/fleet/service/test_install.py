"""The files of a service, and what systemd and udev are told of them, in which order."""

from pathlib import Path

import pytest

from fleet.service.agent_unit import AgentSpec
from fleet.service.devices import Devices
from fleet.service.install import ServiceError, install, run_program, status_of, uninstall
from fleet.service.unit import ServiceSpec

SPEC = ServiceSpec(
    "yard-1", Path("/etc/fleet/fleet.yaml"), Path("/opt/fleet/bin/python"), Devices(("/dev/ttyS0",))
)
AGENT = AgentSpec("yard-1", Path("/etc/fleet/yard-1"), Path("/opt/fleet/bin/python"))


class System:
    """Notes the programs that are run."""

    def __init__(self):
        self.ran = []

    def __call__(self, command):
        self.ran.append(" ".join(command))
        return ""


def test_an_install_writes_unit_user_and_rules_and_then_starts_the_edge(tmp_path):
    system = System()
    written = install(SPEC, tmp_path, system, start=True)
    assert {str(path.relative_to(tmp_path)) for path in written} == {
        "etc/systemd/system/fleet-yard-1.service",
        "etc/sysusers.d/fleet.conf",
        "etc/udev/rules.d/90-fleet-yard-1.rules",
    }
    assert all(path.stat().st_mode & 0o777 == 0o644 for path in written)
    assert system.ran[:3] == ["systemd-sysusers", "systemctl daemon-reload", "udevadm control --reload"]
    assert system.ran[-1] == "systemctl enable --now fleet-yard-1.service"


def test_the_agent_is_a_service_beside_the_edge_and_has_its_folder(tmp_path):
    system = System()
    written = install(SPEC, tmp_path, system, start=True, agent=AGENT)
    assert tmp_path / "etc/systemd/system/fleet-yard-1.agent.service" in written
    given = system.ran.index("chown --recursive --no-dereference fleet:fleet -- /etc/fleet/yard-1")
    assert given > system.ran.index("systemd-sysusers"), "the user is there"
    assert system.ran[-1] == "systemctl enable --now fleet-yard-1.service fleet-yard-1.agent.service"


def test_an_uninstall_removes_the_agent_too(tmp_path):
    install(SPEC, tmp_path, None, start=False, agent=AGENT)
    system = System()
    removed = uninstall("yard-1", tmp_path, system)
    assert system.ran[0] == "systemctl disable --now fleet-yard-1.agent.service fleet-yard-1.service"
    assert {path.name for path in removed} >= {"fleet-yard-1.agent.service", "fleet-yard-1.service"}
    assert not any(path.exists() for path in removed)


def test_for_an_image_no_program_is_run(tmp_path):
    assert len(install(SPEC, tmp_path, None, start=True)) == 3


def test_an_uninstall_stops_the_edge_before_it_removes_the_files(tmp_path):
    install(SPEC, tmp_path, None, start=False)
    system, seen = System(), []
    unit = tmp_path / "etc/systemd/system/fleet-yard-1.service"

    def run(command):
        seen.append(unit.exists())
        return system(command)

    removed = uninstall("yard-1", tmp_path, run)
    assert system.ran[0] == "systemctl disable --now fleet-yard-1.service"
    assert seen[0]
    assert unit in removed
    assert not unit.exists()
    assert (tmp_path / "etc/sysusers.d/fleet.conf").exists()


def test_a_service_that_is_not_installed_cannot_be_removed(tmp_path):
    with pytest.raises(ServiceError, match="there is no service of edge yard-1"):
        uninstall("yard-1", tmp_path, System())


def test_a_folder_that_cannot_be_written_is_reported_with_the_cure(tmp_path):
    (tmp_path / "etc").write_text("")
    with pytest.raises(ServiceError, match="run it as root"):
        install(SPEC, tmp_path, None, start=False)


def test_a_program_that_fails_is_reported_in_its_own_words():
    with pytest.raises(ServiceError, match="no such unit"):
        run_program(["sh", "-c", "echo warning >&2; echo no such unit >&2; exit 5"])
    with pytest.raises(ServiceError, match="this computer has no no-such-program"):
        run_program(["no-such-program"])


def test_the_status_is_what_systemd_says_and_nothing_that_was_not_asked():
    properties = "LoadState=loaded\nActiveState=active\nStatusText=the edge is running\nOther=1\n"
    assert status_of("fleet-yard-1.service", lambda _: properties) == {
        "LoadState": "loaded",
        "ActiveState": "active",
        "StatusText": "the edge is running",
    }
