"""The unit of an edge: what it allows, what it hides, and how systemd rates it."""

import os
import shlex
import signal
import subprocess
import threading
from pathlib import Path

import msgspec
import pytest

from fleet.config.load import load
from fleet.errors import ConfigError
from fleet.service.devices import Devices
from fleet.service.unit import ServiceSpec, spec_of, unit_text

PLAIN = ServiceSpec("yard-1", Path("/etc/fleet/fleet.yaml"), Path("/bin/sh"))
WITH_ALL = ServiceSpec(
    "yard-1",
    Path("/etc/fleet/fleet.yaml"),
    Path("/bin/sh"),
    Devices(("/dev/gpiochip0", "/dev/serial/by-id/usb-x", "/dev/video0"), ("can0",)),
    (Path("/srv/fleet state"),),
)
SPECS = [pytest.param(PLAIN, id="without devices"), pytest.param(WITH_ALL, id="with devices")]


def settings(spec):
    """Return the settings of a unit, each with all its values."""
    found = {}
    for line in unit_text(spec).splitlines():
        if "=" in line and not line.startswith("#"):
            name, _, value = line.partition("=")
            found.setdefault(name, []).append(value)
    return found


@pytest.fixture
def unit(tmp_path, request):
    path = tmp_path / "fleet-yard-1.service"
    path.write_text(unit_text(request.param))
    return path


@pytest.mark.parametrize("unit", SPECS, indirect=True)
def test_systemd_rates_its_exposure_at_most_3(unit, program):
    command = [program("systemd-analyze"), "security", "--offline=true", "--threshold=30", "--no-pager", unit]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "Overall exposure level" in result.stdout


@pytest.mark.parametrize("unit", SPECS, indirect=True)
def test_systemd_finds_nothing_wrong_in_it(unit, program):
    command = [program("systemd-analyze"), "verify", "--man=no", "--recursive-errors=no", unit]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    about_it = [line for line in result.stderr.splitlines() if "fleet-yard-1" in line]
    assert (result.returncode, about_it) == (0, [])


def test_only_the_classes_of_the_named_devices_are_open():
    found = settings(WITH_ALL)
    assert found["DevicePolicy"] == ["closed"]
    assert found["DeviceAllow"] == [
        f"char-{each} rw" for each in ("gpiochip", "ttyACM", "ttyUSB", "video4linux")
    ]
    assert "DeviceAllow" not in settings(PLAIN)
    assert settings(PLAIN)["PrivateDevices"] == ["yes"]


def test_can_and_real_time_are_open_for_robots_on_can_alone():
    assert "AF_CAN" in settings(WITH_ALL)["RestrictAddressFamilies"][0]
    assert settings(WITH_ALL)["LimitRTPRIO"] == ["40"]
    assert "AF_CAN" not in settings(PLAIN)["RestrictAddressFamilies"][0]
    assert settings(PLAIN)["RestrictRealtime"] == ["yes"]


def test_real_time_is_permitted_where_the_file_asks_for_it():
    asking = settings(msgspec.structs.replace(PLAIN, realtime=True))
    assert (asking["LimitRTPRIO"], asking["RestrictRealtime"]) == (["2"], ["no"])
    assert settings(msgspec.structs.replace(WITH_ALL, realtime=True))["LimitRTPRIO"] == ["40"]


def test_it_runs_as_a_user_of_its_own_without_new_privileges():
    found = settings(PLAIN)
    assert (found["User"], found["NoNewPrivileges"], found["CapabilityBoundingSet"]) == (
        ["fleet"],
        ["yes"],
        [""],
    )


def test_systemd_waits_for_readiness_and_watches_the_supervisor():
    found = settings(PLAIN)
    assert (found["Type"], found["NotifyAccess"]) == (["notify"], ["main"])
    assert found["WatchdogSec"] == ["10"]
    assert (found["Restart"], found["RestartPreventExitStatus"]) == (["always"], ["3"])


def test_an_edge_whose_supervisor_is_killed_or_hangs_is_asked_to_end_before_it_is_killed():
    """With KillMode=mixed systemd kills it at once, and its robots go on; a watchdog signals all of them."""
    found = settings(PLAIN)
    assert (found["KillMode"], found["WatchdogSignal"]) == (["control-group"], ["SIGTERM"])
    assert float(found["TimeoutAbortSec"][0]) >= 10.0


@pytest.mark.waits
def test_a_stop_of_the_service_signals_the_supervisor_alone_and_waits_for_its_end():
    (command,) = settings(PLAIN)["ExecStop"]
    words = shlex.split(command.removeprefix("-"))
    with subprocess.Popen(["sleep", "600"]) as main:
        reaper = threading.Thread(target=main.wait)
        reaper.start()
        result = subprocess.run(words, env={**os.environ, "MAINPID": str(main.pid)}, check=False, timeout=20)
        reaper.join(20)
        assert (result.returncode, main.returncode) == (0, -signal.SIGTERM)
    assert subprocess.run(words, env={"PATH": os.environ["PATH"]}, check=False, timeout=20).returncode != 0


def test_nothing_in_a_path_is_expanded_by_systemd():
    spec = ServiceSpec("yard-1", Path("/etc/my fleet/100%$HOME/fleet.yaml"), Path("/bin/sh"))
    (command,) = settings(spec)["ExecStart"]
    assert shlex.split(command)[-1] == "/etc/my fleet/100%%$$HOME/fleet.yaml"


FILE = """\
edge: {id: yard-1}
robots:
  - name: kestrel
    twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
    adapter: mavlink
    link: sim:px4
    system_id: 1
"""


@pytest.fixture
def loaded(tmp_path):
    (tmp_path / "fleet.yaml").write_text(FILE)
    return load(tmp_path / "fleet.yaml")


def test_paths_that_a_service_does_not_see_are_refused_with_the_places_to_use(loaded):
    with pytest.raises(
        ConfigError, match=r"/home/me/fleet.yaml is below /home.*keep the fleet file in /etc/fleet"
    ):
        spec_of(loaded, Path("/home/me/fleet.yaml"), Path("/opt/fleet/bin/python"))
    with pytest.raises(ConfigError, match="/root/venv/bin/python is below /root"):
        spec_of(loaded, Path("/etc/fleet/fleet.yaml"), Path("/root/venv/bin/python"))


def test_a_path_with_a_line_break_is_refused(loaded):
    with pytest.raises(ConfigError, match="cannot stand in"):
        spec_of(loaded, Path("/etc/fleet/a\nUser=root"), Path("/opt/fleet/bin/python"))


def test_the_unit_of_a_loaded_file_names_its_edge(loaded):
    spec = spec_of(loaded, Path("/etc/fleet/fleet.yaml"), Path("/opt/fleet/bin/python"))
    assert spec.unit == "fleet-yard-1.service"
    assert settings(spec)["ExecStart"] == ["/opt/fleet/bin/python -P -m fleet run -- /etc/fleet/fleet.yaml"]
