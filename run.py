"""Runs the project with nothing but git and Python 3.11: ``python3 run.py demo``, ``test`` or ``docs``.

Installs what uv.lock pins into ``.venv`` with uv, which it installs locally if missing. Then it runs ``fleet
demo``, the documentation's build, or the tests. For the tests it also fetches programs outside Python
(tests/programs.py). It needs only the standard library, and works from any folder.
"""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / ".venv"
OWN_UV = ROOT / ".venv-uv"
OLDEST_PYTHON = (3, 11)
OLDEST_UV = (0, 5)
TO_FOLDER = ("--root-user-action=ignore", "--target")  # pip may run as root; it changes only that folder
VENV = "on Debian and Ubuntu: sudo apt-get install -y python3-venv"
USAGE = """usage: python3 run.py demo [options of fleet demo]
       python3 run.py test [--fast | --soak] [options of pytest]
       python3 run.py docs

--fast: only tests that do not wait, about a minute. --soak: many times as many examples, hours."""
# Packages to install for each command, besides the locked runtime packages. The demo keeps installed test
# packages.
PACKAGES = {
    "demo": ["--no-default-groups", "--extra", "all", "--inexact"],
    "test": ["--all-extras"],
    "docs": ["--all-extras", "--group", "docs"],
}
PROGRAMS = {
    "demo": ["fleet", "demo"],
    "test": ["python", "-m", "pytest", "-n", "auto", "--dist", "loadgroup"],
    "docs": ["python", "docs/build.py"],
}


TIERS = {"--soak": ["--soak", "--timeout", "0"]}
"""pytest options for each option of this script. ``--fast`` is pytest's own, from tests/tiers.py."""


class Impossible(Exception):
    """The command cannot run. The message says what to do."""


def say(text: str) -> None:
    """Report progress to the user on standard error."""
    print(f"run.py: {text}", file=sys.stderr, flush=True)


def works(uv: str | Path) -> bool:
    """Return whether a uv program runs and is new enough for uv.lock."""
    try:
        told = subprocess.run([str(uv), "--version"], capture_output=True, text=True, check=False)
    except OSError:
        return False
    version = re.match(r"uv (\d+)\.(\d+)", told.stdout)
    return told.returncode == 0 and version is not None and tuple(map(int, version.groups())) >= OLDEST_UV


def find_uv() -> Path:
    """Return uv: the user's own, or one in ``.venv-uv``, installed with venv and pip or with pip alone."""
    users = shutil.which("uv")
    if users and works(users):
        return Path(users)
    own = OWN_UV / "bin" / "uv"
    if works(own):
        return own
    say("uv is missing: installing it in .venv-uv, for this folder only")
    if importlib.util.find_spec("ensurepip"):
        run(
            [sys.executable, "-m", "venv", "--clear", str(OWN_UV)], f"Python cannot make environments; {VENV}"
        )
        pip = [str(OWN_UV / "bin" / "python"), "-m", "pip", "install"]
    else:  # Debian has ensurepip in a package of its own
        shutil.rmtree(OWN_UV, ignore_errors=True)
        pip = [sys.executable, str(fetch_pip() / "pip"), "install", *TO_FOLDER, str(OWN_UV)]
    OWN_UV.mkdir(exist_ok=True)
    (OWN_UV / ".gitignore").write_text("*\n")
    run([*pip, "--quiet", "uv"], "pip could not install uv; see the lines above, or install uv yourself")
    return own


def fetch_pip() -> Path:
    """Return the folder of a pip that runs without installation; raises Impossible."""
    from tests import programs  # noqa: PLC0415 - rarely needed

    say("this Python has no pip: fetching the distribution's into .venv-programs; nothing is installed")
    try:
        return programs.fetch_pip()
    except programs.Unavailable as error:
        raise Impossible(f"Python has no pip, and {error}; {VENV}") from None


def run(command: list[str], advice: str) -> None:
    """Run a command; raises Impossible with ``advice`` if it fails."""
    environment = os.environ | {
        "UV_PROJECT_ENVIRONMENT": str(ENVIRONMENT),
        "UV_COMPILE_BYTECODE": "1",  # once here instead of at every start
    }
    environment.pop("VIRTUAL_ENV", None)
    if subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode != 0:
        raise Impossible(advice)


def install(word: str) -> None:
    """Sync ``.venv`` with uv.lock. Prints only if packages have changed and the user may have to wait."""
    uv = find_uv()
    stamp = ENVIRONMENT / f".ready-for-{word}"
    newest = max((ROOT / name).stat().st_mtime for name in ("uv.lock", "pyproject.toml"))
    ready = stamp.exists() and stamp.stat().st_mtime > newest
    if not ready:
        say("installing the packages that uv.lock pins into .venv")
    command = [str(uv), "sync", "--frozen", "--python", sys.executable, *PACKAGES[word]]
    run(command + ["--quiet"] * ready, "uv could not install the packages; see the lines above")
    stamp.touch()


def fetch_programs() -> None:
    """Fetch the programs that the tests need outside Python.

    If one is unavailable, the reason is printed, and its tests are skipped.
    """
    from tests import programs  # noqa: PLC0415 - the demo does not need it

    why = programs.fetch(say)
    if why:
        say(f"{why}; the tests that need it do not run")
        os.environ[programs.WHY_MISSING] = why


def start(arguments: list[str]) -> None:
    """Install, then replace this process with the program, or print the usage; raises Impossible."""
    if sys.version_info < OLDEST_PYTHON:
        raise Impossible(
            f"this is Python {sys.version.split()[0]}; at least 3.11 is needed: python3.11 run.py ..."
        )
    if arguments[:1] in (["-h"], ["--help"]):
        print(USAGE)
        return
    if not arguments or arguments[0] not in PROGRAMS:
        raise Impossible(f"the command is missing or unknown\n{USAGE}")
    word, *options = arguments
    install(word)
    if word == "test":
        fetch_programs()
    os.chdir(ROOT)
    name, *rest = PROGRAMS[word]
    program = str(ENVIRONMENT / "bin" / name)
    expanded = [word for option in options for word in TIERS.get(option, [option])]
    os.execv(program, [program, *rest, *expanded])


if __name__ == "__main__":
    try:
        start(sys.argv[1:])
    except Impossible as error:
        say(str(error))
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
