"""The systemd unit of the agent of an edge's roll-outs, generated beside the unit of the edge; pure.

It has the user and the sandbox of the edge, but no device: it communicates with the store and the edge, and
writes the folder of the bundles.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from fleet.errors import ConfigError
from fleet.rollout.bundle import FLEET_FILE
from fleet.rollout.installation import CURRENT
from fleet.rollout.settings import FILE
from fleet.service.unit import FAMILIES, SANDBOX, check_paths, command_line, places, text_of, unit_name


class AgentSpec(msgspec.Struct, frozen=True):
    """Input of the unit of an agent.

    ``folder`` contains the bundles, ``python`` is the interpreter of its environment.
    """

    edge: str
    folder: Path
    python: Path

    @property
    def unit(self) -> str:
        """The name of the unit."""
        return agent_unit_name(self.edge)


def agent_unit_name(edge: str) -> str:
    """Return the name of the unit of an edge's agent; no edge's own unit has the dot."""
    return f"fleet-{edge}.agent.service"


def agent_spec_of(edge: str, file: Path, python: Path) -> AgentSpec:
    """Return the input of the unit of an edge's agent from its fleet file; the paths are absolute.

    Raises ConfigError if the fleet file does not come from a roll-out, or if a service cannot use a path.
    """
    folder = file.parent.parent
    if file.parent.name != CURRENT or not (folder / FILE).is_file():
        raise ConfigError(
            f"{file} comes from no roll-out: an agent needs FOLDER/{CURRENT}/{file.name}, with "
            f"FOLDER/{FILE} (docs/how-to/roll-out.md)"
        )
    check_paths((folder, python))
    return AgentSpec(edge, folder, python)


def agent_text(spec: AgentSpec) -> str:
    """Return the text of the unit.

    The agent starts after the edge and ends before it. It also runs without the edge, so that a bundle with
    which the edge does not start can be replaced. An invalid rollout.yaml (3) needs a person.
    """
    unit = [
        f"Description=agent of the roll-outs of fleet edge {spec.edge}",
        f"After=network-online.target time-sync.target {unit_name(spec.edge)}",
        "Wants=network-online.target",
        "StartLimitIntervalSec=0",
    ]
    command = [spec.python, "-P", "-m", "fleet", "rollout", "agent", "--", spec.folder]
    process = [
        "Type=exec",
        f"ExecStart={command_line(command)}",
        "Restart=always",
        "RestartSec=5",
        "RestartPreventExitStatus=3",
        "SuccessExitStatus=130 143",
        "TimeoutStopSec=30",
        "LimitCORE=0",
        f"SyslogIdentifier=fleet-{spec.edge}.agent",
    ]
    closed = [
        "DevicePolicy=closed",
        "PrivateDevices=yes",
        "RestrictRealtime=yes",
        f"RestrictAddressFamilies={FAMILIES}",
    ]
    lines = [*process, *places(spec.edge, spec.folder, (spec.folder,)), *closed, *SANDBOX]
    written_by = f"fleet service install --agent {spec.folder / CURRENT / FLEET_FILE}"
    return text_of(written_by, unit, lines)
