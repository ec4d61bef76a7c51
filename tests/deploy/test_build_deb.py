"""The Debian package: what it declares, where its programs look, and that it never changes under an edge."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.build_deb import PLACE, SCRIPTS, control_text, relocate, version_in
from fleet.version import __version__
from tests.tools.waiting import wait_until

ROOT = Path(__file__).parents[2]


def fields(text):
    lines = [line for line in text.splitlines() if line[0] != " "]
    return dict(line.split(": ", 1) for line in lines)


def test_it_depends_on_the_minor_version_of_python_that_its_environment_is_made_for():
    control = fields(control_text("1.2.0", "arm64", (3, 13), 1000))
    assert (control["Package"], control["Version"], control["Architecture"]) == (
        "zenoh-fleet",
        "1.2.0",
        "arm64",
    )
    assert "python3 (>= 3.13~), python3 (<< 3.14~)" in control["Depends"]


def test_its_version_is_that_of_fleet_in_debians_form():
    assert version_in((ROOT / "fleet" / "version.py").read_text()) == __version__.replace(".dev", "~dev")
    assert version_in('__version__ = "0.3.0.dev1"\n') == "0.3.0~dev1"


def test_dpkg_takes_the_control_file_and_the_scripts(tmp_path):
    control = tmp_path / "DEBIAN"
    control.mkdir()
    (control / "control").write_text(control_text("1.2.0", "all", (3, 11), 1))
    for name in ("postinst", "prerm"):
        (control / name).write_bytes((SCRIPTS / name).read_bytes())
        (control / name).chmod(0o755)
    subprocess.run(["dpkg-deb", "--build", tmp_path, tmp_path / "a.deb"], check=True, capture_output=True)


@pytest.fixture
def environment(tmp_path):
    """Return an environment as venv, uv and pip make it, in a folder that the target does not have."""
    folder = tmp_path / "built" / PLACE
    notes = folder / "lib/python3.11/site-packages/zenoh_fleet-1.dist-info"
    programs = folder / "bin"
    notes.mkdir(parents=True)
    programs.mkdir()
    (notes / "direct_url.json").write_text('{"url": "file:///build/fleet.whl"}')
    (notes / "METADATA").write_text("Name: zenoh-fleet\n")
    (programs / "python").symlink_to("/usr/bin/python3")
    (programs / "fleet").write_text(f"#!{programs}/python\nfrom fleet.__main__ import main\n")
    (programs / "activate").write_text(f"VIRTUAL_ENV={folder}\n")
    (programs / "mavgen.py").write_text(f"#!{programs}/python\n")
    (folder / ".lock").touch()
    (folder / "pyvenv.cfg").write_text(
        f"home = /usr/bin\nversion = 3.11.2\ncommand = python3 -m venv {folder}\n"
    )
    return folder


def test_nothing_in_it_names_the_folder_in_which_it_was_built(environment):
    relocate(environment, PLACE)
    files = [path for path in environment.rglob("*") if path.is_file() and not path.is_symlink()]
    assert [path for path in files if str(environment).encode() in path.read_bytes()] == []
    assert (environment / "bin" / "fleet").read_text().startswith("#!/opt/fleet/bin/python\n")
    assert (environment / "pyvenv.cfg").read_text() == "home = /usr/bin\nversion = 3.11.2\n"


def test_of_its_programs_only_fleet_and_python_stay(environment):
    relocate(environment, PLACE)
    assert {path.name for path in (environment / "bin").iterdir()} == {"fleet", "python"}
    assert not (environment / ".lock").exists()


def script(name, *arguments):
    return subprocess.run(["sh", SCRIPTS / name, *arguments], capture_output=True, text=True, check=False)


@pytest.fixture
def edge():
    """Run a process that is called as an edge of the package is, and wait until it has that name."""
    code = "import sys; sys.stdin.read()"
    process = subprocess.Popen(
        ["/opt/fleet/bin/python", "-c", code], executable=sys.executable, stdin=subprocess.PIPE
    )
    named = Path(f"/proc/{process.pid}/cmdline")
    wait_until("its name", lambda: named.read_bytes().startswith(b"/opt/fleet/bin/python"))
    yield process
    process.stdin.close()
    process.wait()


@pytest.mark.parametrize("action", ["remove", "upgrade", "failed-upgrade", "deconfigure"])
def test_it_is_neither_upgraded_nor_removed_under_a_running_edge(edge, action):
    done = script("prerm", action)
    assert done.returncode == 1
    assert str(edge.pid) in done.stderr
    assert "Bring its robots to rest" in done.stderr


def test_other_programs_of_python_are_not_in_its_way(edge):
    assert str(os.getpid()) not in script("prerm", "remove").stderr.split()


def test_a_first_installation_says_what_comes_next_and_an_upgrade_what_it_did_not_restart():
    assert "fleet service install" in script("postinst", "configure", "").stdout
    assert "upgraded from 0.1.0" in script("postinst", "configure", "0.1.0").stdout
