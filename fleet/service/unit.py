"""The systemd unit of an edge, generated from its fleet file; pure.

``systemd-analyze security --offline=true`` rates it; the tests require a rating of 3.0 or better. The
network, reading the clock and /proc stay open, because robots, the bus, the cloud and the edge's load need
them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec

from fleet.bus.settings import SERVICE_RUNTIME
from fleet.config.load import Loaded
from fleet.config.schema import Sections
from fleet.errors import ConfigError
from fleet.rollout.installation import CURRENT
from fleet.runtime.realtime import WATCHER
from fleet.service.devices import Devices, devices_of, unsafe_names

USER = GROUP = "fleet"
STATE = Path("/var/lib")  # StateDirectory= of systemd; the edges' folders are below fleet/ there
CONFIG = Path("/etc/fleet")
# s without a message of the supervisor, after which systemd asks it and all others to end
WATCHDOG = 10
REALTIME = 40  # highest real-time priority for control loops of quadrupeds on CAN
HIDDEN = tuple(map(Path, ("/home", "/root", "/run/user", "/tmp", "/var/tmp")))  # noqa: S108 - hidden from a service
FAMILIES = "AF_UNIX AF_INET AF_INET6 AF_NETLINK"  # of sockets: the bus, the cloud, and the list of networks
# signals the supervisor and waits for its end; fails where it is dead already
_END = "kill -TERM $MAINPID && exec tail --pid=$MAINPID -s 0.1 -f /dev/null"
_WORD = re.compile(r"[A-Za-z0-9_./:@+,=-]+")


class ServiceSpec(msgspec.Struct, frozen=True):
    """Input of the unit of an edge.

    ``file`` is its fleet file, ``python`` the interpreter of its environment, ``writable`` the folders that
    it writes besides those created by systemd. ``of_a_pair``: the file is for two edges; this is one of them.
    ``realtime``: its event loops ask for real-time priority.
    """

    edge: str
    file: Path
    python: Path
    devices: Devices = Devices()
    writable: tuple[Path, ...] = ()
    of_a_pair: bool = False
    realtime: bool = False

    @property
    def unit(self) -> str:
        """The name of the unit."""
        return unit_name(self.edge)

    @property
    def folder(self) -> Path:
        """The working directory: not the folder of the ``current`` link, whose target a roll-out removes."""
        return self.file.parent.parent if self.file.parent.name == CURRENT else self.file.parent


def unit_name(edge: str) -> str:
    """Return the name of the unit of an edge."""
    return f"fleet-{edge}.service"


def spec_of(loaded: Loaded, file: Path, python: Path) -> ServiceSpec:
    """Return the input of the unit of a loaded fleet file; the paths are absolute.

    Raises ConfigError with all reasons why a service is not possible.
    """
    config = loaded.config
    pair = config.pair is not None
    spec = ServiceSpec(
        config.edge.id,
        file,
        python,
        devices_of(loaded),
        _writable(config),
        of_a_pair=pair,
        realtime=config.edge.realtime,
    )
    check_paths((spec.file, spec.python, *spec.writable), unsafe_names(spec.devices))
    return spec


def _writable(config: Sections) -> tuple[Path, ...]:
    """Return the folders of state and recordings with their own place in fleet.yaml."""
    record = config.record.folder if config.record else None
    return tuple(path.absolute() for path in (config.edge.spool.path, record) if path is not None)


def check_paths(paths: Sequence[Path], unsafe: Sequence[str] = ()) -> None:
    """Raise ConfigError with all reasons why a service cannot use these paths.

    Home folders and temporary folders are hidden from it. ``unsafe`` are other names that could be
    misinterpreted in the files of a service, such as a path with a line break.
    """
    problems = [
        f"{path} is below {folder}, which a service does not see: keep the fleet file in {CONFIG}, state in "
        f"{STATE}/fleet and the Python environment in /opt"
        for path in paths
        for folder in HIDDEN
        if path.is_relative_to(folder)
    ]
    broken = [str(path) for path in paths if not str(path).isprintable()]
    problems += [f"{name!r} cannot stand in a unit or udev rule" for name in (*unsafe, *broken)]
    if problems:
        raise ConfigError("; ".join(problems))


def word(value: object) -> str:
    """Return one word of a unit, quoted if necessary, with nothing that systemd would expand."""
    text = str(value).replace("%", "%%")
    if _WORD.fullmatch(text):
        return text
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def command_line(words: Iterable[object]) -> str:
    """Return the command line of a unit; a dollar sign is escaped, since it would name a variable."""
    return " ".join(word(str(each).replace("$", "$$")) for each in words)


def unit_text(spec: ServiceSpec) -> str:
    """Return the text of the unit."""
    service = [*_process(spec), *places(spec.edge, spec.folder, spec.writable), *_devices(spec), *SANDBOX]
    return text_of(f"fleet service install {spec.file}", _unit(spec), service)


def text_of(written_by: str, unit: Iterable[str], service: Iterable[str]) -> str:
    """Return the text of a unit that starts at boot, from the lines of its sections."""
    head = f"# Written by: {written_by}\n# An own drop-in keeps changes: systemctl edit\n"
    sections = (("Unit", unit), ("Service", service), ("Install", ("WantedBy=multi-user.target",)))
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

    The first process is the supervisor. ExecStop= signals it alone and waits, so that it ends the edge, and
    the edge its robots and workers. If it dies or hangs, all others get SIGTERM, and bring their robots to a
    standstill; with KillMode=mixed systemd kills them at once (seen with systemd 252). Processes that remain
    are killed after TimeoutStopSec=. An invalid fleet file (3) waits for a person.
    """
    which = ["--edge-id", spec.edge] if spec.of_a_pair else []
    command = [spec.python, "-P", "-m", "fleet", "run", *which, "--", spec.file]
    return [
        "Type=notify",
        "NotifyAccess=main",
        f"ExecStart={command_line(command)}",
        f"ExecStop=-/bin/sh -c '{_END}'",
        f"WatchdogSec={WATCHDOG}",
        "WatchdogSignal=SIGTERM",
        "TimeoutAbortSec=15",
        "Restart=always",
        "RestartSec=1",
        "RestartPreventExitStatus=3",
        "SuccessExitStatus=7 130 143",
        "TimeoutStartSec=120",
        "TimeoutStopSec=30",
        "KillMode=control-group",
        "OOMPolicy=continue",
        "OOMScoreAdjust=-500",
        "LimitNOFILE=65536",
        "LimitCORE=0",
        f"SyslogIdentifier=fleet-{spec.edge}",
    ]


def places(edge: str, folder: Path, writable: Iterable[Path]) -> list[str]:
    """Return user, folders and environment. Only the group may use the sockets."""
    lines = [
        f"User={USER}",
        f"Group={GROUP}",
        "UMask=0007",
        f"WorkingDirectory={str(folder).replace('%', '%%')}",
        "StateDirectory=fleet",
        "StateDirectoryMode=0700",
        f"RuntimeDirectory={SERVICE_RUNTIME.name}",
        "RuntimeDirectoryMode=0750",
        "RuntimeDirectoryPreserve=yes",
        f"Environment=FLEET_RUNTIME_DIR={SERVICE_RUNTIME} XDG_STATE_HOME={STATE} HOME={STATE}/fleet",
        f"EnvironmentFile=-{CONFIG}/{edge}.env",
    ]
    return lines + [f"ReadWritePaths={word(path)}" for path in writable]


def _devices(spec: ServiceSpec) -> list[str]:
    """Return the lines that allow the devices of the fleet file and no others."""
    families = FAMILIES
    lines = [f"DeviceAllow={each} rw" for each in spec.devices.classes]
    if not spec.devices.files:
        lines.append("PrivateDevices=yes")
    if spec.devices.interfaces:
        lines += [f"LimitRTPRIO={REALTIME}", "LimitMEMLOCK=infinity", "RestrictRealtime=no"]
        families += " AF_CAN"
    elif spec.realtime:
        lines += [f"LimitRTPRIO={WATCHER}", "RestrictRealtime=no"]
    else:
        lines.append("RestrictRealtime=yes")
    return ["DevicePolicy=closed", *lines, f"RestrictAddressFamilies={families}"]


SANDBOX = (
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
