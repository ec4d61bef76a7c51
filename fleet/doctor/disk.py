"""Space and durability of the edge's disk."""

from __future__ import annotations

import os
from pathlib import Path

import msgspec

from fleet.doctor.finding import Finding, error, ok, warning

CHECK = "disk"
LOGS = 48 << 20  # bytes of the log of one process: six files of 8 MiB
_IN_MEMORY = frozenset({"tmpfs", "ramfs", "overlay"})
_MIB = 1 << 20


class DiskState(msgspec.Struct, frozen=True):
    """The file system of the edge's folder: bytes and inodes available to users, and its type."""

    folder: Path
    free: int
    inodes: int = 1 << 20
    read_only: bool = False
    kind: str = ""


def read_disk(folder: Path, mounts: Path = Path("/proc/self/mounts")) -> DiskState:
    """Return the file system of a folder, which may not exist yet; raises OSError."""
    there = next(path for path in (folder, *folder.parents) if path.exists())
    found = os.statvfs(there)
    # A file system without an inode table reports 0 of 0.
    inodes = found.f_favail if found.f_files else 1 << 20
    read_only = bool(found.f_flag & os.ST_RDONLY)
    return DiskState(folder, found.f_bavail * found.f_frsize, inodes, read_only, _kind(there, mounts))


def _kind(folder: Path, mounts: Path) -> str:
    """Return the type of the file system with the longest mount point above a folder."""
    kind, longest = "", -1
    for line in mounts.read_text(errors="replace").splitlines():
        _, point, found, *_ = line.split()
        point = point.replace("\\040", " ")
        if folder.resolve().is_relative_to(point) and len(point) >= longest:
            kind, longest = found, len(point)
    return kind


def check_disk(disk: DiskState, needed: int) -> Finding:
    """Check the disk; this edge may still write ``needed`` bytes within its own limits."""
    free, wanted = disk.free // _MIB, needed // _MIB
    other = "or set edge.spool.path in fleet.yaml to a folder on another disk"
    if disk.read_only:
        return error(
            CHECK,
            f"{disk.folder} is read-only: at the start every robot is stopped until its release",
            f"mount it writable, {other}",
        )
    if disk.free < _MIB or disk.inodes < 100:
        return error(
            CHECK, f"{disk.folder} has no room: {free} MiB, {disk.inodes} files", f"make room, {other}"
        )
    if disk.free < needed:
        return warning(
            CHECK,
            f"{free} MiB are free at {disk.folder}; the edge may write {wanted} MiB more",
            f"make room, lower edge.spool.size and edge.history.size, {other}",
        )
    if disk.kind in _IN_MEMORY:
        return warning(
            CHECK,
            f"{disk.folder} is on {disk.kind}: emergency stops and queued messages are lost with the power",
            f"keep it on a disk, or mount a volume there; {other}",
        )
    return ok(CHECK, f"{free} MiB free at {disk.folder}")


def size_of(folder: Path) -> int:
    """Return the bytes of all files in a folder and below."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
