"""Writes the files of an edge's service, and reloads systemd and udev.

The files are written below a root folder; for the root of the running system, systemd's programs are run as
well. ``run`` runs one program and raises ServiceError, so that tests need no systemd.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from fleet.errors import FleetError
from fleet.service.agent_unit import AgentSpec, agent_text, agent_unit_name
from fleet.service.devices import udev_rules
from fleet.service.unit import GROUP, USER, ServiceSpec, sysusers_text, unit_name, unit_text

RunProgram = Callable[[Sequence[str]], str]
_HEAD = "# Written by fleet service install\n"
_WITHIN = 120.0  # s for one program


class ServiceError(FleetError):
    """The service cannot be installed, queried or removed."""


def files_of(spec: ServiceSpec, agent: AgentSpec | None = None) -> dict[Path, str]:
    """Return the files of a service and its ``agent``, relative to the root folder, with their text."""
    files = {
        Path("etc/systemd/system", spec.unit): unit_text(spec),
        Path("etc/sysusers.d/fleet.conf"): _HEAD + sysusers_text(),
    }
    if agent is not None:
        files[Path("etc/systemd/system", agent.unit)] = agent_text(agent)
    rules = udev_rules(spec.devices, GROUP)
    if rules:
        files[_rules_file(spec.edge)] = _HEAD + rules
    return files


def _rules_file(edge: str) -> Path:
    """Return the path of the udev rules; the number orders them after the rules that create names."""
    return Path("etc/udev/rules.d", f"90-fleet-{edge}.rules")


def unit_file(edge: str, root: Path = Path("/")) -> Path:
    """Return the path of an edge's unit, existing or not."""
    return root / "etc/systemd/system" / unit_name(edge)


def install(
    spec: ServiceSpec, root: Path, run: RunProgram | None, *, start: bool, agent: AgentSpec | None = None
) -> list[Path]:
    """Write the files below ``root``; with ``run``, load and enable them, and ``start`` the edge.

    With ``agent``, its unit is installed too, and its folder is given to the user of the service. Returns the
    files. A running edge is not restarted: it uses the new unit from its next start on. Raises ServiceError.
    """
    files = files_of(spec, agent)
    for path, text in files.items():
        write_whole(root / path, text)
    if run is not None:
        run(["systemd-sysusers"])
        if agent is not None:
            run(["chown", "--recursive", "--no-dereference", f"{USER}:{GROUP}", "--", str(agent.folder)])
        _reload(run, devices=bool(udev_rules(spec.devices, GROUP)))
        units = [spec.unit, *([agent.unit] if agent else [])]
        run(["systemctl", "enable", *(["--now"] if start else []), *units])
    return [root / path for path in files]


def uninstall(edge: str, root: Path, run: RunProgram | None) -> list[Path]:
    """Stop and disable the service and its agent, and remove their files.

    State, fleet file, bundles and user stay. Returns the removed files. Raises ServiceError, also if no
    service of this edge is installed.
    """
    unit, rules = unit_file(edge, root), root / _rules_file(edge)
    agent = unit.with_name(agent_unit_name(edge))
    if not unit.exists():
        raise ServiceError(f"there is no service of edge {edge}: {unit} does not exist")
    removed = [path for path in (agent, unit, rules) if path.exists()]
    if run is not None:
        run(["systemctl", "disable", "--now", *(path.name for path in removed if path != rules)])
    for path in removed:
        path.unlink()
    if run is not None:
        _reload(run, devices=rules in removed)
    return removed


def _reload(run: RunProgram, *, devices: bool) -> None:
    """Reload the units of systemd and the rules of udev, and apply them to plugged-in devices."""
    run(["systemctl", "daemon-reload"])
    if devices:
        run(["udevadm", "control", "--reload"])
        run(["udevadm", "trigger", "--action=change", "--subsystem-match=tty", "--subsystem-match=gpio"])
        run(["udevadm", "trigger", "--action=change", "--subsystem-match=hidraw"])
        run(["udevadm", "trigger", "--action=change", "--subsystem-match=video4linux"])


def write_whole(path: Path, text: str) -> None:
    """Write a file atomically; raises ServiceError."""
    fresh = path.with_name(f".{path.name}.new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        fresh.write_text(text, encoding="utf-8")
        fresh.chmod(0o644)
        fresh.replace(path)
    except OSError as error:
        raise ServiceError(f"cannot write {path}: {error.strerror}; run it as root (sudo)") from None


def run_program(command: Sequence[str]) -> str:
    """Run a program of the system; return its output. Raises ServiceError with its error message."""
    try:
        ran = subprocess.run(  # noqa: S603 - systemd's own programs, with arguments of ours
            command, capture_output=True, text=True, check=False, timeout=_WITHIN, stdin=subprocess.DEVNULL
        )
    except FileNotFoundError:
        raise ServiceError(f"this computer has no {command[0]}: a service needs systemd") from None
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ServiceError(f"{' '.join(command)}: {error}") from None
    if ran.returncode != 0:
        words = ran.stderr.strip().splitlines() or [f"exit code {ran.returncode}"]
        raise ServiceError(f"{' '.join(command)}: {' '.join(words[-2:])}")  # systemctl says what, then where
    return ran.stdout


def is_root() -> bool:
    """Return True for the user who may install services."""
    return os.geteuid() == 0


def status_of(unit: str, run: RunProgram) -> Mapping[str, str]:
    """Return systemd's properties of a unit; raises ServiceError."""
    output = run(["systemctl", "show", f"--property={','.join(PROPERTIES)}", unit])
    pairs = (line.partition("=") for line in output.splitlines())
    return {name: value for name, _, value in pairs if name in PROPERTIES}


PROPERTIES = (
    "LoadState",
    "ActiveState",
    "SubState",
    "UnitFileState",
    "StatusText",
    "MainPID",
    "NRestarts",
    "Result",
    "ActiveEnterTimestamp",
)
"""Properties shown by ``fleet service status``."""
