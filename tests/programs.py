"""Programs outside Python that the tests use: where they are, and how a machine without them gets them.

A program that is not on PATH is fetched as the distribution's package, with those libraries that are not
installed, into ``.venv-programs`` beside ``.venv``: apt-get downloads with lists and a cache of its own
there, ``dpkg -x`` unpacks, and a script in ``.venv-programs/bin`` starts the program with its libraries.
Nothing is installed, no service is started, no rights are asked for. Standard library only: run.py calls it.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).resolve().parents[1] / ".venv-programs"
WHY_MISSING = "FLEET_TESTS_WHY_MISSING"  # environment variable: run.py tells the tests why a fetch failed
_SYSTEM = ("/usr/sbin", "/usr/local/sbin")  # where servers are, which a user's PATH may leave out
_CANNOT_RUN = (126, 127)  # exit codes of sh and of the loader: not executable, or a library is missing


class Program(NamedTuple):
    """One program: ``package`` of Debian and Ubuntu, ``path`` inside it, ``check``: an argument that ends it.

    ``files`` are environment variables that name files of the package where it would look in the system.
    """

    package: str
    path: str
    check: str
    files: Mapping[str, str] = {}


WANTED: Mapping[str, Program] = {
    "mosquitto": Program("mosquitto", "usr/sbin/mosquitto", "-h"),
    "mosquitto_pub": Program("mosquitto-clients", "usr/bin/mosquitto_pub", "--help"),
    "openssl": Program("openssl", "usr/bin/openssl", "version", {"OPENSSL_CONF": "etc/ssl/openssl.cnf"}),
}


class Unavailable(Exception):
    """A program cannot be had on this machine; the message says why."""


def find(name: str) -> str | None:
    """Return the path of a program of ``WANTED``: the system's, else the fetched one, else None."""
    places = [*os.environ.get("PATH", "").split(os.pathsep), *_SYSTEM, str(FOLDER / "bin")]
    return shutil.which(name, path=os.pathsep.join(places))


def fetch(say: Callable[[str], None]) -> str:
    """Fetch the programs that are missing; return why one still is, empty when all are there."""
    missing = [name for name in WANTED if not _runs(name)]
    if not missing:
        return ""
    say(f"fetching {', '.join(missing)} for the tests into .venv-programs; nothing is installed")
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / ".gitignore").write_text("*\n")
    with tempfile.TemporaryDirectory(prefix="apt-", dir=FOLDER) as state:
        try:
            apt = _Apt(Path(state))
        except Unavailable as error:
            return str(error)
        return "; ".join(why for name in missing if (why := _fetched(name, apt)))


def _fetched(name: str, apt: _Apt) -> str:
    """Fetch one program; return why it cannot be had, empty when it is there."""
    try:
        _unpack(name, apt.download(WANTED[name].package))
    except Unavailable as error:
        return str(error)
    return ""


def _runs(name: str) -> bool:
    """Return True when a program is there and, if fetched, still finds its libraries."""
    path = find(name)
    if path is None or not path.startswith(str(FOLDER)):
        return path is not None
    told = subprocess.run([path, WANTED[name].check], capture_output=True, check=False)
    return told.returncode not in _CANNOT_RUN


class _Apt:
    """apt-get with package lists and a cache in a folder of ours; it reads the system's sources and keys."""

    def __init__(self, state: Path) -> None:
        program = shutil.which("apt-get")
        if program is None or shutil.which("dpkg") is None:
            raise Unavailable("this system has no apt-get: install them with its own package manager")
        self._archives = state / "archives"
        for folder in (state / "lists" / "partial", self._archives / "partial"):
            folder.mkdir(parents=True)
        options = {
            "Dir::State::Lists": state / "lists",
            "Dir::Cache": state,
            "Debug::NoLocking": "1",  # the locks are root's; nothing of the system is written
            "APT::Sandbox::User": "",  # as root: root's folder cannot be read by apt's own user
            "Acquire::Retries": "1",
            "Acquire::http::Timeout": "20",
            "Acquire::https::Timeout": "20",
        }
        self._command = [program, "--quiet", "--yes", *(f"-o{key}={value}" for key, value in options.items())]
        self._run("update")  # one broken source of several is no matter: a failing download says more

    def download(self, package: str) -> list[Path]:
        """Return the package's files and those of what it needs and is not installed; raises Unavailable."""
        failed = self._run("install", "--download-only", "--no-install-recommends", package)
        if failed:
            raise Unavailable(f"apt-get could not fetch {package}: {failed}")
        return sorted(self._archives.glob("*.deb"))

    def _run(self, *arguments: str) -> str:
        """Run it; return the last error when it fails, else nothing."""
        command = [*self._command, *arguments]
        english = os.environ | {"LC_ALL": "C"}
        told = subprocess.run(command, capture_output=True, text=True, check=False, env=english)
        lines = [line for line in told.stderr.splitlines() if line.startswith(("E:", "W:"))]
        return "" if told.returncode == 0 else (lines or ["E: no reason given"])[-1][2:].strip()


def _unpack(name: str, packages: list[Path]) -> None:
    """Unpack packages and write the script that starts a program; raises Unavailable when it cannot run."""
    root, script = FOLDER / "root", FOLDER / "bin" / name
    for package in packages:
        if subprocess.run(["dpkg", "-x", str(package), str(root)], check=False).returncode != 0:
            raise Unavailable(f"dpkg could not unpack {package.name}")
    libraries = sorted({str(path.parent) for path in root.rglob("*.so*")})
    values = {key: str(root / path) for key, path in WANTED[name].files.items()}
    values["LD_LIBRARY_PATH"] = os.pathsep.join(libraries)
    lines = [f"export {key}={shlex.quote(value)}" for key, value in values.items()]
    lines.append(f'exec {shlex.quote(str(root / WANTED[name].path))} "$@"')
    script.parent.mkdir(exist_ok=True)
    script.write_text("\n".join(["#!/bin/sh", *lines, ""]))
    script.chmod(0o755)
    if not _runs(name):
        script.unlink()
        raise Unavailable(f"{name} was fetched, but it does not run here")
