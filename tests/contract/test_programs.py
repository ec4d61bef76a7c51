"""Programs outside Python: fetched without rights where they are missing, and never missing in silence."""

import shutil
import subprocess
import sys

import pytest

APT_GET = """
archives=$(echo "$@" | sed 's/.*Dir::Cache=\\([^ ]*\\).*/\\1/')/archives
case "$*" in
*update*) [ -n "$OFFLINE" ] || touch "$archives/../lists/here_Packages"; echo "W: $OFFLINE" >&2 ;;
*no-such-package*) echo 'E: Unable to locate package no-such-package' >&2; exit 100 ;;
*) touch "$archives/pump_1.0_all.deb" "$archives/python3-pip-whl_1.0_all.deb" ;;
esac"""
DPKG = """
mkdir -p "$3/usr/bin" "$3/usr/lib/here" "$3/etc" "$3/usr/share/python-wheels"
touch "$3/usr/lib/here/libwater.so.1" "$3/etc/pump.conf" "$3/usr/share/python-wheels/pip-1.0-py3-none-any.whl"
printf '#!/bin/sh\\necho "$LD_LIBRARY_PATH $PUMP_CONF$PUMP_FONTS $*"\\n%s' "$PUMP_ENDS" > "$3/usr/bin/pump"
chmod +x "$3/usr/bin/pump\""""


@pytest.fixture
def programs(tmp_path, monkeypatch, module_at):
    """Return tests/programs.py on a machine of its own: a fake apt-get and dpkg, and nothing unpacked yet."""
    programs = module_at("programs.py")
    system = tmp_path / "system"
    system.mkdir()
    for name, text in {"apt-get": APT_GET, "dpkg": DPKG}.items():
        script(system / name, text)
    for name in ("sh", "sed", "touch", "mkdir", "chmod", "cat"):
        (system / name).symlink_to(shutil.which(name))
    monkeypatch.setenv("PATH", str(system))
    monkeypatch.setattr(programs, "_SYSTEM", ())
    monkeypatch.setattr(programs, "FOLDER", tmp_path / ".venv-programs")
    files = {"PUMP_CONF": "etc/pump.conf", "PUMP_FONTS": "etc/fonts"}
    pump = programs.Program("pump", "usr/bin/pump", "-h", files, ("water-pump",))
    monkeypatch.setattr(programs, "WANTED", {"pump": pump})
    return programs


def test_a_missing_program_is_unpacked_and_starts_with_its_own_libraries_and_files(programs):
    said = []
    assert programs.fetch(said.append) == ""
    assert said == ["fetching pump for the tests into .venv-programs; nothing is installed"]
    root = programs.FOLDER / "root"
    result = subprocess.run([programs.find("pump"), "two words"], capture_output=True, text=True, check=True)
    assert result.stdout == f"{root}/usr/lib/here {root}/etc/pump.conf two words\n"
    assert sorted(path.name for path in programs.FOLDER.iterdir()) == [".gitignore", "bin", "root"]


def test_what_is_there_is_not_fetched_again(programs):
    programs.fetch(lambda _: None)
    said = []
    assert programs.fetch(said.append) == ""
    assert said == []


@pytest.mark.parametrize("name", ["pump", "water-pump"])
def test_the_systems_own_program_or_another_that_does_as_well_is_used(programs, tmp_path, name):
    own = script(tmp_path / "system" / name, "exit 0")
    said = []
    assert programs.fetch(said.append) == ""
    assert (said, programs.find("pump")) == ([], str(own))


def test_a_package_that_cannot_be_fetched_is_reported_and_the_others_are_fetched(programs, monkeypatch):
    lost = programs.Program("no-such-package", "usr/bin/lost", "-h")
    monkeypatch.setattr(programs, "WANTED", {"lost": lost, **programs.WANTED})
    why = programs.fetch(lambda _: None)
    assert why == "apt-get could not fetch no-such-package: Unable to locate package no-such-package"
    assert programs.find("pump") is not None
    assert programs.find("lost") is None


def test_a_machine_without_network_is_reported(programs, monkeypatch):
    monkeypatch.setenv("OFFLINE", "Temporary failure resolving 'mirror.example'")
    assert programs.fetch(lambda _: None) == (
        "apt-get could not fetch the lists of packages: Temporary failure resolving 'mirror.example'"
    )


def test_a_python_without_pip_gets_the_distributions(programs):
    assert programs.fetch_pip().name == "pip-1.0-py3-none-any.whl"


def test_a_fetched_program_that_does_not_run_is_missing(programs, monkeypatch):
    monkeypatch.setenv("PUMP_ENDS", "exit 127\n")
    assert programs.fetch(lambda _: None) == "pump was fetched, but it does not run here"
    assert programs.find("pump") is None


def test_a_fetched_program_that_has_lost_its_libraries_is_fetched_again(programs):
    programs.fetch(lambda _: None)
    (programs.FOLDER / "root" / "usr" / "bin" / "pump").unlink()
    said = []
    assert programs.fetch(said.append) == ""
    assert len(said) == 1
    assert programs.find("pump") is not None


@pytest.mark.parametrize("missing", ["apt-get", "dpkg"])
def test_a_system_with_other_packages_is_reported(programs, tmp_path, missing):
    (tmp_path / "system" / missing).unlink()
    assert programs.fetch(lambda _: None).startswith("this system has no apt-get: install them")


@pytest.mark.parametrize(("ci", "code", "workers"), [("true", 1, "1"), ("", 0, "0")])
def test_the_last_line_says_what_did_not_run_and_why_and_in_ci_that_is_an_error(
    root, tmp_path, ci, code, workers
):
    for name in ("conftest.py", "hangs.py", "programs.py", "tiers.py"):
        shutil.copy(root / "tests" / name, tmp_path)
    (tmp_path / "test_one.py").write_text(
        "import pytest\n"
        "@pytest.mark.parametrize('name', ['no-browser', 'no-browser', 'no-nats'])\n"
        "def test_that_needs_one(program, name):\n    program(name)\n"
        "def test_that_needs_none():\n    pass\n"
    )
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n", workers, "--rootdir", ".", "-c", "/dev/null", "."],
        cwd=tmp_path,
        env={"PATH": "/usr/bin:/bin", "CI": ci, "FLEET_TESTS_WHY_MISSING": "no network"},
        capture_output=True,
        text=True,
        check=False,
    )
    last = "3 tests did not run: no-browser is missing (2), no-nats is missing (1); no network"
    assert result.stdout.splitlines()[-1] == last
    assert result.returncode == code, result.stdout


def script(path, text):
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path
