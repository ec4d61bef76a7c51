"""Builder of the Debian package: ``python3 -m deploy.build_deb``.

Run it in a checkout, on the distribution release that the package is for. The package contains
``/usr/bin/fleet`` and, in /opt/fleet, a virtual environment with what uv.lock pins. The environment is made
for the building computer's system Python and works with that minor version only. The package starts nothing:
``fleet service install`` writes the units. Building needs dpkg-deb, and uv or pip to install uv.
"""

from __future__ import annotations

import argparse
import gzip
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from run import Impossible, find_uv

ROOT = Path(__file__).resolve().parent.parent
SCRIPTS = ROOT / "deploy" / "debian"
NAME = "zenoh-fleet"
PLACE = Path("opt/fleet")
_PROGRAMS = re.compile(r"fleet|python[0-9.]*")  # programs of the environment that are kept


def control_text(version: str, architecture: str, python: tuple[int, int], kilobytes: int) -> str:
    """Return the package's control file, for one minor version of the distribution's Python."""
    major, minor = python
    return f"""Package: {NAME}
Version: {version}
Architecture: {architecture}
Maintainer: zenoh-fleet developers <developers@zenoh-fleet.invalid>
Installed-Size: {kilobytes}
Depends: libc6 (>= 2.28), python3 (>= {major}.{minor}~), python3 (<< {major}.{minor + 1}~)
Recommends: systemd, udev
Section: net
Priority: optional
Description: Orchestrator for mixed fleets of robots, at the edge
 One fleet.yaml, one command: drones (MAVLink), quadrupeds (CAN) and wheeled robots (serial) on a
 Zenoh bus, bridged to the Cyberwave cloud.
 .
 Installs a Python environment in /opt/fleet and the command fleet; starts nothing.
"""


def relocate(environment: Path, place: Path) -> None:
    """Prepare an environment to run at ``place``.

    Keeps only ``fleet`` and the interpreters of its programs, and makes ``fleet`` start the interpreter at
    ``place``. Other references to the build folder are removed, such as the path of the wheel.
    """
    programs = environment / "bin"
    for path in programs.iterdir():
        if not _PROGRAMS.fullmatch(path.name):
            path.unlink()
    command = programs / "fleet"
    command.write_text(
        command.read_text(encoding="utf-8").replace(f"{programs}/", f"/{place}/bin/"), encoding="utf-8"
    )
    settings = environment / "pyvenv.cfg"
    lines = settings.read_text(encoding="utf-8").splitlines(keepends=True)
    settings.write_text("".join(line for line in lines if not line.startswith("command")), encoding="utf-8")
    for path in environment.glob("lib/python*/site-packages/*.dist-info/direct_url.json"):
        path.unlink()
    (environment / ".lock").unlink(missing_ok=True)  # left by uv


def version_in(source: str) -> str:
    """Return the version in the text of fleet/version.py, in Debian's form (0.2.0~dev0 is older)."""
    return str(re.findall(r'^__version__ = "(.+)"', source, re.MULTILINE)[0]).replace(".dev", "~dev")


def _run(*command: str | Path) -> str:
    """Run a command in the checkout and return its output; raises Impossible with the command."""
    words = [str(word) for word in command]
    try:
        done = subprocess.run(words, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)  # noqa: S603 - our own commands
    except FileNotFoundError:
        raise Impossible(f"this computer has no {words[0]}; on Debian: apt-get install dpkg-dev") from None
    except subprocess.CalledProcessError as error:
        raise Impossible(f"{' '.join(words)} ended with code {error.returncode}") from None
    return done.stdout.strip()


def fill(environment: Path, python: Path, scratch: Path) -> None:
    """Create the environment with this checkout and the hash-verified locked packages; raises Impossible."""
    uv, pins = find_uv(), scratch / "requirements.txt"
    _run(python, "-m", "venv", "--without-pip", environment)
    _run(uv, "build", "--quiet", "--wheel", "--out-dir", scratch)
    locked = ("--frozen", "--no-dev", "--no-emit-project", "--extra", "all")
    _run(uv, "export", "--quiet", *locked, "--output-file", pins)
    own = environment / "bin" / "python"
    install = (
        uv,
        "--directory",
        scratch,
        "pip",
        "install",
        "--quiet",
        "--link-mode",
        "copy",
        "--python",
        own,
    )
    _run(*install, "--require-hashes", "--requirement", pins)  # [tool.uv] does not apply in that folder
    _run(*install, "--no-deps", *scratch.glob("*.whl"))
    relocate(environment, PLACE)
    # Bytecode is not checked against its source at start: the package always replaces both.
    compiled = ("-q", "-s", environment.parent.parent, "-p", "/", "--invalidation-mode", "unchecked-hash")
    _run(python, "-m", "compileall", *compiled, environment / "lib")


def add_files(root: Path) -> None:
    """Add the files outside /opt: the command, the folder for fleet files, licence and changelog."""
    command = root / "usr" / "bin" / "fleet"
    command.parent.mkdir(parents=True)
    command.symlink_to(f"/{PLACE}/bin/fleet")
    (root / "etc" / "fleet").mkdir(parents=True)
    told = root / "usr" / "share" / "doc" / NAME
    told.mkdir(parents=True)
    shutil.copyfile(ROOT / "LICENSE", told / "copyright")
    text = (ROOT / "CHANGELOG.md").read_bytes()
    (told / "changelog.gz").write_bytes(gzip.compress(text, mtime=0))


def add_control(root: Path, version: str, python: tuple[int, int]) -> None:
    """Add the control file and the maintainer scripts; raises Impossible."""
    folder = root / "DEBIAN"
    folder.mkdir()
    files = [path for path in root.rglob("*") if path.is_file() and not path.is_symlink()]
    kilobytes = sum(path.stat().st_size for path in files) // 1024
    architecture = _run("dpkg", "--print-architecture")
    text = control_text(version, architecture, python, kilobytes)
    (folder / "control").write_text(text, encoding="utf-8")
    for name in ("postinst", "prerm"):
        shutil.copy(SCRIPTS / name, folder / name)


def build(python: Path, output: Path) -> Path:
    """Build the package into the folder ``output`` and return its path; raises Impossible."""
    version = version_in((ROOT / "fleet" / "version.py").read_text(encoding="utf-8"))
    told = _run(python, "-c", "import sys; print(*sys.version_info[:2])").split()
    minor = (int(told[0]), int(told[1]))
    output.mkdir(parents=True, exist_ok=True)
    os.umask(0o022)
    with tempfile.TemporaryDirectory() as folder:
        scratch, root = Path(folder), Path(folder, "root")
        fill(root / PLACE, python, scratch)
        add_files(root)
        add_control(root, version, minor)
        root.chmod(0o755)
        _run("dpkg-deb", "--root-owner-group", "--build", root, output)
    return max(output.glob(f"{NAME}_{version}_*.deb"), key=lambda path: path.stat().st_mtime)


def main(arguments: Sequence[str]) -> int:
    """Build the package and print its path; the exit code is 2 if that fails."""
    parser = argparse.ArgumentParser(
        prog="python3 -m deploy.build_deb", description="Build the Debian package."
    )
    parser.add_argument(
        "--python", type=Path, default=Path("/usr/bin/python3"), help="the distribution's Python"
    )
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder of the package")
    options = parser.parse_args(arguments)
    try:
        sys.stdout.write(f"{build(options.python, options.output.absolute())}\n")
    except Impossible as error:
        sys.stderr.write(f"build_deb: {error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
