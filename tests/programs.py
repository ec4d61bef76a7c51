"""Programs outside Python that the tests use: where they are, and how a machine without them gets them.

A program that is not on PATH is fetched as the distribution's package, with those libraries that are not
installed, into ``.venv-programs`` beside ``.venv``: apt-get downloads with lists and a cache of its own
there, ``dpkg -x`` unpacks, and a script in ``.venv-programs/bin`` starts the program with its libraries.
Nothing is installed, no service is started, no rights are asked for. Standard library only: run.py calls it,
also for pip where Python comes without it.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).resolve().parents[1] / ".venv-programs"
WHY_MISSING = "FLEET_TESTS_WHY_MISSING"  # environment variable: run.py tells the tests why a fetch failed
_SYSTEM = ("/usr/sbin", "/usr/local/sbin")  # where servers are, which a user's PATH may leave out
_CANNOT_RUN = (126, 127)  # exit codes of sh and of the loader: not executable, or a library is missing


class Program(NamedTuple):
    """One program: ``package`` of Debian and Ubuntu, ``path`` inside it, ``check``: an argument that ends it.

    ``files`` are environment variables that name files of the package where it would look in the system.
    ``others`` are names of programs that do as well, where they are on PATH.
    """

    package: str
    path: str
    check: str
    files: Mapping[str, str] = {}
    others: tuple[str, ...] = ()


WANTED: Mapping[str, Program] = {
    "chromium": Program(
        "chromium-headless-shell",  # a third smaller than the whole browser, which needs GTK besides
        "usr/lib/chromium/chromium-headless-shell",
        "--version",
        {"FONTCONFIG_PATH": "etc/fonts", "XDG_DATA_HOME": "usr/share"},
        ("chromium-headless-shell", "google-chrome"),
    ),
    "mosquitto": Program("mosquitto", "usr/sbin/mosquitto", "-h"),
    "mosquitto_pub": Program("mosquitto-clients", "usr/bin/mosquitto_pub", "--help"),
    "openssl": Program("openssl", "usr/bin/openssl", "version", {"OPENSSL_CONF": "etc/ssl/openssl.cnf"}),
    "promtool": Program("prometheus", "usr/bin/promtool", "--version"),
    "systemd-analyze": Program("systemd", "usr/bin/systemd-analyze", "--version"),
}


class Unavailable(Exception):
    """A program cannot be had on this machine; the message says why."""


def find(name: str) -> str | None:
    """Return the path of a program of ``WANTED``: the system's, else the fetched one, else None."""
    places = os.pathsep.join([*os.environ.get("PATH", "").split(os.pathsep), *_SYSTEM, str(FOLDER / "bin")])
    others = WANTED[name].others if name in WANTED else ()
    return next(filter(None, (shutil.which(each, path=places) for each in (name, *others))), None)


def fetch(say: Callable[[str], None]) -> str:
    """Fetch the programs that are missing; return why one still is, empty when all are there."""
    missing = [name for name in WANTED if not _runs(name)]
    if not missing:
        return ""
    say(f"fetching {', '.join(missing)} for the tests into .venv-programs; nothing is installed")
    try:
        with _apt() as apt:
            return "; ".join(why for name in missing if (why := _fetched(name, apt)))
    except Unavailable as error:
        return str(error)


def fetch_pip() -> Path:
    """Fetch pip for a Python that comes without it, as Debian's does; return its wheel, which runs as it is.

    Raises Unavailable.
    """
    with _apt() as apt:
        root = _unpack(apt.download("python3-pip-whl"))
    wheels = sorted(root.glob("usr/share/python-wheels/pip-*.whl"))
    if not wheels:
        raise Unavailable("python3-pip-whl holds no pip")
    return wheels[-1]


def _fetched(name: str, apt: _Apt) -> str:
    """Fetch one program; return why it cannot be had, empty when it is there."""
    try:
        _write_script(name, _unpack(apt.download(WANTED[name].package)))
    except Unavailable as error:
        return str(error)
    return ""


def _runs(name: str) -> bool:
    """Return True when a program is there and, if fetched, still finds its libraries."""
    path = find(name)
    if path is None or not path.startswith(str(FOLDER)):
        return path is not None
    result = subprocess.run([path, WANTED[name].check], capture_output=True, check=False)
    return result.returncode not in _CANNOT_RUN


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
        said = self._run("update")
        if not list((state / "lists").glob("*_Packages*")):  # one broken source of several is no matter
            raise Unavailable(f"apt-get could not fetch the lists of packages: {said}")

    def download(self, package: str) -> list[Path]:
        """Return the package's files and those of what it needs and is not installed; raises Unavailable."""
        said = self._run("install", "--download-only", "--no-install-recommends", package)
        if not list(self._archives.glob(f"{package}_*.deb")):
            raise Unavailable(f"apt-get could not fetch {package}: {said}")
        return sorted(self._archives.glob("*.deb"))

    def _run(self, *arguments: str) -> str:
        """Run it; return its last error or warning."""
        command = [*self._command, *arguments]
        english = os.environ | {"LC_ALL": "C"}
        result = subprocess.run(command, capture_output=True, text=True, check=False, env=english)
        lines = [line[2:].strip() for line in result.stderr.splitlines() if line.startswith(("E:", "W:"))]
        return lines[-1] if lines else f"it ended with {result.returncode}"


@contextlib.contextmanager
def _apt() -> Iterator[_Apt]:
    """Give apt-get a folder for as long as it is needed; raises Unavailable."""
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / ".gitignore").write_text("*\n")
    with tempfile.TemporaryDirectory(prefix="apt-", dir=FOLDER) as state:
        yield _Apt(Path(state))


def _unpack(packages: list[Path]) -> Path:
    """Unpack packages and return where; raises Unavailable."""
    root = FOLDER / "root"
    for package in packages:
        if subprocess.run(["dpkg", "-x", str(package), str(root)], check=False).returncode != 0:
            raise Unavailable(f"dpkg could not unpack {package.name}")
    return root


def _write_script(name: str, root: Path) -> None:
    """Write the script that starts an unpacked program; raises Unavailable when it does not run."""
    script = FOLDER / "bin" / name
    libraries = sorted({str(path.parent) for path in root.rglob("*.so*")})
    # What the system has is not unpacked, and found where it is.
    values = {key: str(root / path) for key, path in WANTED[name].files.items() if (root / path).exists()}
    values["LD_LIBRARY_PATH"] = os.pathsep.join(libraries)
    lines = [f"export {key}={shlex.quote(value)}" for key, value in values.items()]
    lines.append(f'exec {shlex.quote(str(root / WANTED[name].path))} "$@"')
    script.parent.mkdir(exist_ok=True)
    script.write_text("\n".join(["#!/bin/sh", *lines, ""]))
    script.chmod(0o755)
    if not _runs(name):
        script.unlink()
        raise Unavailable(f"{name} was fetched, but it does not run here")
