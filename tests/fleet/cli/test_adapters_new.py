"""A generated package passes its own tests as it is, and nothing of anybody's is overwritten."""

import importlib.util
import os
import re
import shlex
import subprocess
import sys
import zipfile

import pytest

from fleet.cli.adapters_new import KINDS, package
from fleet.plugins.registry import Registry

HERE = shlex.quote(sys.executable)


@pytest.fixture(params=list(KINDS))
def kind(request):
    return request.param


BUILD = """
import os, sys
from setuptools import build_meta

into, *folders = sys.argv[1:]
for folder in folders:
    os.chdir(folder)
    build_meta.build_wheel(into)
"""


def installed(folders, into):
    """Install packages as wheels, entry points included, into a folder; return an environment with them."""
    for_all = [sys.executable, "-c", BUILD, str(into), *map(str, folders)]
    subprocess.run(for_all, capture_output=True, text=True, check=True)
    for wheel in into.glob("*.whl"):
        zipfile.ZipFile(wheel).extractall(into)
    return os.environ | {"PYTHONPATH": str(into), "PYTHONWARNINGS": ""}


def test_the_tests_of_new_packages_pass_as_they_are_and_fleet_finds_them(fleet, place, tmp_path):
    names = {kind: f"{kind}-wheeler" for kind in KINDS}
    for kind, name in names.items():
        assert fleet("adapters", "new", name, "--kind", kind).code == 0
    site = tmp_path / "site"
    site.mkdir()
    environment = installed([place / name for name in names.values()], site)
    tests = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:asyncio"]
    for name in names.values():
        result = subprocess.run(
            tests, cwd=place / name, env=environment, capture_output=True, text=True, check=False
        )
        assert result.returncode == 0, result.stdout
        assert int(re.search(r"(\d+) passed", result.stdout)[1]) >= 15
    shown = [sys.executable, "-m", "fleet", "adapters", "--json"]
    found = subprocess.run(
        shown, cwd=site, env=environment, capture_output=True, text=True, check=True
    ).stdout
    assert all(f'"{name}"' in found for name in names.values())


def test_it_says_what_it_wrote_and_what_comes_next(fleet, place):
    result = fleet("adapters", "new", "six-wheeler")
    written = result.out.splitlines()
    assert written[0] == "wrote six-wheeler/pyproject.toml"
    assert all((place / line.removeprefix("wrote ")).is_file() for line in written)
    assert len(written) == len(list((place / "six-wheeler").rglob("*.*")))
    assert result.err.startswith("next: cd six-wheeler && ")
    assert result.err.endswith("python -m pytest\n")


@pytest.mark.parametrize(
    ("pip", "expected"),
    [
        (True, "&& python -m pip install -e '.[test]' && python -m pytest"),
        (False, f"&& uv pip install --python {HERE} -e '.[test]' && {HERE} -m pytest"),
    ],
)
def test_the_installer_that_comes_next_is_one_that_the_environment_has(
    fleet, place, monkeypatch, pip, expected
):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: pip and name == "pip")
    assert expected in fleet("adapters", "new", "six-wheeler").err


def test_a_program_gets_the_files_as_json(fleet, place):
    document = fleet("adapters", "new", "hexapod", "--kind", "can", "--into", "robots", "--json").json
    assert document["adapter"] == "hexapod"
    assert "robots/hexapod/fleet_hexapod/adapter.py" in document["written"]


def test_what_is_there_stays_as_it_is(fleet, place):
    (place / "rover").mkdir()
    (place / "rover" / "precious.txt").write_text("mine")
    result = fleet("adapters", "new", "rover")
    assert result.code == 1
    assert "rover is there already; it stays as it is" in result.err
    assert [path.name for path in (place / "rover").iterdir()] == ["precious.txt"]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Rover", "use small letters"),
        ("2wheels", "use small letters"),
        ("a_b", "use small letters"),
        ("a--b", "use small letters"),
        ("../evil", "use small letters"),
        ("x" * 41, "at most 40 of them"),
        ("class", "is a word of its own here"),
        ("new", "is a word of its own here"),
        ("mavlink", "there is an adapter 'mavlink' already"),
    ],
)
def test_a_name_that_cannot_be_is_refused(fleet, place, name, expected):
    before = sorted(place.iterdir())
    result = fleet("adapters", "new", name)
    assert result.code == 2
    assert expected in " ".join(result.err.split())
    assert sorted(place.iterdir()) == before


def test_a_kind_that_is_none_is_reported_with_those_there_are(fleet, place):
    assert "'frame', 'can', 'sdk'" in fleet("adapters", "new", "rover", "--kind", "ros").err


def test_help_shows_the_kinds_and_an_example(fleet):
    help_text = fleet("adapters", "new", "--help").out
    assert "frames on a CAN bus" in help_text
    assert "For example:  fleet adapters new hexapod --kind can" in help_text


def test_an_adapter_of_frames_is_short():
    for kind in ("frame", "can"):
        assert package("rover", kind)["fleet_rover/adapter.py"].count("\n") < 50


def test_nothing_of_a_template_is_left(kind):
    for path, text in package("six-wheeler", kind).items():
        assert not re.search(r"@[a-z]+@", path + text), path
        assert not path.endswith(".py") or compile(text, path, "exec")


def test_the_list_is_what_is_shown_without_a_command(fleet, place):
    shown = fleet("adapters").out
    assert shown == fleet("adapters", "show").out
    assert all(name in shown for name in Registry().names())
