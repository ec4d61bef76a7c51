"""File permissions: the edge's user can open what it needs, and no one else the secrets. Opens nothing."""

from __future__ import annotations

import grp
import os
import pwd
import stat
from collections.abc import Iterable, Mapping
from pathlib import Path

import msgspec

from fleet.doctor.finding import Finding, error, ok, unknown, warning
from fleet.plugins.drop_in_file import WRITABLE_BY_OTHERS
from fleet.service.devices import Devices

PERMISSIONS, DEVICES, CAN = "permissions", "devices", "can"
READ, WRITE = 4, 2


class Account(msgspec.Struct, frozen=True):
    """The user account of the edge."""

    name: str
    user: int
    groups: frozenset[int]

    def may(self, found: os.stat_result, wanted: int) -> bool:
        """Return True if the permissions of a file grant ``wanted`` (READ, WRITE or both)."""
        if self.user == 0:
            return True
        shift = 6 if found.st_uid == self.user else 3 if found.st_gid in self.groups else 0
        return (found.st_mode >> shift) & wanted == wanted


def account(name: str | None = None) -> Account:
    """Return the account of a user by name, else of this process; raises KeyError for an unknown name."""
    if name is None:
        return Account(_name(os.geteuid()), os.geteuid(), frozenset((os.getegid(), *os.getgroups())))
    found = pwd.getpwnam(name)
    return Account(name, found.pw_uid, frozenset(os.getgrouplist(name, found.pw_gid)))


def _name(user: int) -> str:
    """Return the name of a user, else the number."""
    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return str(user)


def check_state_folder(folder: Path, who: Account) -> Finding:
    """Check the permissions of the state folder: only for its user."""
    try:
        found = folder.stat()
    except FileNotFoundError:
        return ok(PERMISSIONS, f"{folder} is made at the first start")
    except OSError as problem:
        return unknown(PERMISSIONS, f"{folder}: {problem.strerror}", "run fleet doctor as root (sudo)")
    if not who.may(found, READ | WRITE):
        return error(
            PERMISSIONS,
            f"{who.name} cannot write {folder}: no emergency stop survives a restart",
            f"chown -R {who.name} {folder}",
        )
    if found.st_mode & 0o077:
        return warning(
            PERMISSIONS, f"others may read {folder}, which has commands and addresses", f"chmod 700 {folder}"
        )
    return ok(PERMISSIONS, f"{folder} is {who.name}'s alone")


def check_readable(files: Iterable[Path], who: Account) -> list[Finding]:
    """Check that the edge can read fleet.yaml and its included files."""
    findings = []
    for file in files:
        try:
            readable = who.may(file.stat(), READ)
        except OSError as problem:
            findings.append(error(PERMISSIONS, f"{file}: {problem.strerror}", "make it, or correct its name"))
            continue
        if not readable:
            findings.append(
                error(
                    PERMISSIONS, f"{who.name} cannot read {file}", f"chown {who.name} {file}, with mode 600"
                )
            )
    return findings or [ok(PERMISSIONS, f"{who.name} can read the fleet file and its parts")]


def check_plugins(folders: Iterable[Path]) -> list[Finding]:
    """Check the folders and files of drop-in adapters: write access to them is control of this process."""
    paths = [path for folder in folders for path in (folder, *sorted(folder.glob("*.py")))]
    return [
        error(PERMISSIONS, f"others may write {path}, and so decide what runs here", f"chmod go-w {path}")
        for path in paths
        if path.stat().st_mode & WRITABLE_BY_OTHERS
    ]


def check_devices(devices: Devices, who: Account, holders: Mapping[int, str]) -> list[Finding]:
    """Check the devices in the fleet file; ``holders``: programs by the device number that they have open.

    No device is opened: that could reset a board or take bytes from a robot.
    """
    return [_check_device(Path(file), who, holders) for file in devices.files]


def _check_device(file: Path, who: Account, holders: Mapping[int, str]) -> Finding:
    """Check one device."""
    try:
        found = file.stat()
    except OSError as problem:
        return error(DEVICES, f"{file}: {problem.strerror}", "plug it in; see ls -l /dev/serial/by-id")
    if not stat.S_ISCHR(found.st_mode):
        return error(DEVICES, f"{file} is no device", "correct its name in fleet.yaml")
    if not who.may(found, READ | WRITE):
        group = _group(found.st_gid)
        return error(
            DEVICES,
            f"{who.name} cannot open {file} (group {group})",
            f"fleet service install gives it to the service; else: usermod -aG {group} {who.name} and log in",
        )
    if holder := holders.get(found.st_rdev):
        return warning(
            DEVICES, f"{file} is open in {holder}", "stop that program, unless it is the edge itself"
        )
    return ok(DEVICES, f"{file} can be opened by {who.name}")


def _group(number: int) -> str:
    """Return the name of a group, else the number."""
    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return str(number)


def holders_of_devices(proc: Path = Path("/proc")) -> dict[int, str]:
    """Return programs that have character devices open, by device number; other users' only for root."""
    found: dict[int, str] = {}
    for link in proc.glob("[0-9]*/fd/*"):
        try:
            opened = link.stat()
            if stat.S_ISCHR(opened.st_mode):
                name = (link.parents[1] / "comm").read_text().strip()
                found[opened.st_rdev] = f"{name} (process {link.parents[1].name})"
        except OSError:  # it has ended, or belongs to another user
            continue
    return found


def check_can(devices: Devices, network: Path = Path("/sys/class/net")) -> list[Finding]:
    """Check the CAN interfaces in the fleet file: present, up, and with a short queue."""
    return [_check_interface(name, network / name) for name in devices.interfaces]


def _check_interface(name: str, folder: Path) -> Finding:
    """Check one CAN interface; its bit rate is set outside, and not visible here."""
    up = f"ip link set {name} up type can bitrate 1000000 (with the rate of your drives)"
    if not folder.exists():
        return error(CAN, f"there is no interface {name}", f"plug in its adapter, load its driver; then {up}")
    if not int((folder / "flags").read_text(), 16) & 1:
        return error(CAN, f"{name} is down", up)
    queue = int((folder / "tx_queue_len").read_text())
    if queue > 32:
        return warning(
            CAN,
            f"{name} queues {queue} frames: those in it while motor power is off are sent when it returns",
            f"ip link set {name} txqueuelen 16",
        )
    return ok(CAN, f"{name} is up")
