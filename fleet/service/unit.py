"""The systemd unit of an edge, generated from its fleet file; pure.

``systemd-analyze security --offline=true`` rates it; the tests require a rating of 3.0 or better. The
network, reading the clock and /proc stay open, because robots, the bus, the cloud and the edge's load need
them.
"""

from __future__ import annotations

import re
from pathlib import Path

import msgspec

from fleet.bus.settings import SERVICE_RUNTIME
from fleet.config.load import Loaded
from fleet.config.schema import Sections
from fleet.errors import ConfigError
from fleet.service.devices import Devices, devices_of, unsafe_names

USER = GROUP = "fleet"
STATE = Path("/var/lib")  # StateDirectory= of systemd; the edges' folders are below fleet/ there
CONFIG = Path("/etc/fleet")
WATCHDOG = 10  # s without a sign of life of the supervisor before systemd kills it; edge and workers then end
REALTIME = 40  # the priority that control loops of quadrupeds on CAN request
HIDDEN = tuple(map(Path, ("/home", "/root", "/run/user", "/tmp", "/var/tmp")))  # noqa: S108 - folders hidden from a service
_WORD = re.compile(r"[A-Za-z0-9_./:@+,=-]+")


class ServiceSpec(msgspec.Struct, frozen=True):
    """Input of the unit of an edge.

    ``file`` is its fleet file, ``python`` the interpreter of its environment, ``writable`` the folders that
    it writes besides those created by systemd. ``of_a_pair``: the file is for two edges; this is one of them.
    """

    edge: str
    file: Path
    python: Path
    devices: Devices = Devices()
    writable: tuple[Path, ...] = ()
    of_a_pair: bool = False

    @property
    def unit(self) -> str:
        """The name of the unit."""
        return unit_name(self.edge)


def unit_name(edge: str) -> str:
    """Return the name of the unit of an edge."""
    return f"fleet-{edge}.service"


def spec_of(loaded: Loaded, file: Path, python: Path) -> ServiceSpec:
    """Return the input of the unit of a loaded fleet file; the paths are absolute.

    Raises ConfigError with all reasons why a service is not possible.
    """
    config = loaded.config
    pair = config.pair is not None
    spec = ServiceSpec(config.edge.id, file, python, devices_of(loaded), _writable(config), of_a_pair=pair)
    problems = [*_hidden(spec), *(f"{name!r} cannot stand in a unit or udev rule" for name in _unsafe(spec))]
    if problems:
        raise ConfigError("; ".join(problems))
    return spec


def _writable(config: Sections) -> tuple[Path, ...]:
    """Return the folders of state and recordings with their own place in fleet.yaml."""
    record = config.record.folder if config.record else None
    return tuple(path.absolute() for path in (config.edge.spool.path, record) if path is not None)


def _hidden(spec: ServiceSpec) -> list[str]:
    """Return errors for paths hidden from a service: home folders, and temporary ones."""
    return [
        f"{path} is below {folder}, which a service does not see: keep the fleet file in {CONFIG}, state in "
        f"{STATE}/fleet and the Python environment in /opt"
        for path in (spec.file, spec.python, *spec.writable)
        for folder in HIDDEN
        if path.is_relative_to(folder)
    ]


def _unsafe(spec: ServiceSpec) -> list[str]:
    """Return the names of devices and paths that would be misread in the files of a service."""
    paths = [str(path) for path in (spec.file, spec.python, *spec.writable)]
    return [*unsafe_names(spec.devices), *(path for path in paths if not path.isprintable())]


def _word(value: object) -> str:
    """Return one word of a unit: quoted if necessary, and protected from expansion by systemd."""
    text = str(value).replace("%", "%%")
    if _WORD.fullmatch(text):
        return text
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _argument(value: object) -> str:
    """Return one word of a command line of a unit, in which a dollar sign would start a variable."""
    return _word(str(value).replace("$", "$$"))


def unit_text(spec: ServiceSpec) -> str:
    """Return the text of the unit."""
    sections = (
        ("Unit", _unit(spec)),
        ("Service", [*_process(spec), *_places(spec), *_devices(spec), *_SANDBOX]),
        ("Install", ["WantedBy=multi-user.target"]),
    )
    head = (
        f"# Written by: fleet service install {spec.file}\n# An own drop-in keeps changes: systemctl edit\n"
    )
    return head + "".join(
        f"\n[{name}]\n" + "".join(f"{line}\n" for line in lines) for name, lines in sections
    )


def _unit(spec: ServiceSpec) -> list[str]:
    """Return the order of the start: after the network and a set clock, which are not required."""
    can = [f"sys-subsystem-net-devices-{name}.device" for name in spec.devices.interfaces if name.isalnum()]
    return [
        f"Description=fleet edge {spec.edge}",
        f"After={' '.join(['network-online.target', 'time-sync.target', *can])}",
        "Wants=network-online.target",
        "StartLimitIntervalSec=0",
    ]


def _process(spec: ServiceSpec) -> list[str]:
    """Return the lines for running, monitoring and stopping the process.

    The first process is the supervisor. Only it is signalled at first (mixed), so that it ends the edge, and
    the edge its robots and workers; remaining processes are killed after TimeoutStopSec=. An invalid fleet
    file (3) waits for a person.
    """
    which = ["--edge-id", spec.edge] if spec.of_a_pair else []
    command = [spec.python, "-P", "-m", "fleet", "run", *which, "--", spec.file]
    return [
        "Type=notify",
        "NotifyAccess=main",
        f"ExecStart={' '.join(map(_argument, command))}",
        f"WatchdogSec={WATCHDOG}",
        "Restart=always",
        "RestartSec=1",
        "RestartPreventExitStatus=3",
        "SuccessExitStatus=7 130 143",
        "TimeoutStartSec=120",
        "TimeoutStopSec=30",
        "KillMode=mixed",
        "OOMPolicy=continue",
        "OOMScoreAdjust=-500",
        "LimitNOFILE=65536",
        "LimitCORE=0",
        f"SyslogIdentifier=fleet-{spec.edge}",
    ]


def _places(spec: ServiceSpec) -> list[str]:
    """Return user, folders and environment. Only the group may use the sockets."""
    lines = [
        f"User={USER}",
        f"Group={GROUP}",
        "UMask=0007",
        f"WorkingDirectory={str(spec.file.parent).replace('%', '%%')}",
        "StateDirectory=fleet",
        "StateDirectoryMode=0700",
        f"RuntimeDirectory={SERVICE_RUNTIME.name}",
        "RuntimeDirectoryMode=0750",
        "RuntimeDirectoryPreserve=yes",
        f"Environment=FLEET_RUNTIME_DIR={SERVICE_RUNTIME} XDG_STATE_HOME={STATE} HOME={STATE}/fleet",
        f"EnvironmentFile=-{CONFIG}/{spec.edge}.env",
    ]
    return lines + [f"ReadWritePaths={_word(path)}" for path in spec.writable]


def _devices(spec: ServiceSpec) -> list[str]:
    """Return the lines that allow the devices of the fleet file, and no others."""
    families = "AF_UNIX AF_INET AF_INET6 AF_NETLINK"
    lines = [f"DeviceAllow={each} rw" for each in spec.devices.classes]
    if not spec.devices.files:
        lines.append("PrivateDevices=yes")
    if spec.devices.interfaces:
        lines += [f"LimitRTPRIO={REALTIME}", "LimitMEMLOCK=infinity", "RestrictRealtime=no"]
        families += " AF_CAN"
    else:
        lines.append("RestrictRealtime=yes")
    return ["DevicePolicy=closed", *lines, f"RestrictAddressFamilies={families}"]


_SANDBOX = (
    "NoNewPrivileges=yes",
    "CapabilityBoundingSet=",
    "AmbientCapabilities=",
    "ProtectSystem=strict",
    "ProtectHome=yes",
    "PrivateTmp=yes",
    "ProtectProc=invisible",
    "ProtectKernelTunables=yes",
    "ProtectKernelModules=yes",
    "ProtectKernelLogs=yes",
    "ProtectControlGroups=yes",
    "ProtectClock=yes",
    "ProtectHostname=yes",
    "LockPersonality=yes",
    "MemoryDenyWriteExecute=yes",
    "RestrictNamespaces=yes",
    "RestrictSUIDSGID=yes",
    "SystemCallArchitectures=native",
    "SystemCallFilter=@system-service",
    "SystemCallFilter=~@privileged",
    "SystemCallErrorNumber=EPERM",
)


def sysusers_text() -> str:
    """Return the user and the group of the service in the format of systemd-sysusers."""
    return f'u {USER} - "fleet of robots" {STATE}/fleet /usr/sbin/nologin\n'
