import pathlib
import re
import stat
from importlib import resources

from fleet.cli.init import _UUID

ROOT = pathlib.Path(__file__).parents[3]


def test_it_writes_a_fleet_file_and_a_place_for_secrets(fleet, place):
    result = fleet("init", "new")
    assert result.code == 0
    assert result.out == "wrote new/fleet.yaml\nwrote new/secrets.yaml\n"
    assert stat.S_IMODE((place / "new" / "secrets.yaml").stat().st_mode) == 0o600
    assert (place / "new" / "fleet.yaml").exists()


def test_each_file_has_twins_of_its_own(fleet, place):
    fleet("init", "a")
    fleet("init", "b")
    twins = [set(_UUID.findall((place / each / "fleet.yaml").read_text())) for each in "ab"]
    assert len(twins[0] | twins[1]) == 6


def test_what_it_writes_passes_the_check(fleet, place):
    fleet("init", "new")
    result = fleet("check", "new/fleet.yaml")
    assert (result.code, result.err) == (0, "")


def test_the_cloud_section_works_when_it_is_uncommented(fleet, place):
    fleet("init", "new")
    file, secrets = place / "new" / "fleet.yaml", place / "new" / "secrets.yaml"
    file.write_text(re.sub(r"^# (cloud:|  host:|  token:)", r"\1", file.read_text(), flags=re.MULTILINE))
    secrets.write_text(secrets.read_text().replace("# cyberwave_token: cw_...", "cyberwave_token: cw_1"))
    assert "cloud mqtt.cyberwave.com" in fleet("check", "new/fleet.yaml").out


def test_nothing_is_overwritten(fleet, place):
    before = (place / "fleet.yaml").read_text()
    result = fleet("init")
    assert (result.code, result.out) == (1, "")
    assert "fleet.yaml is there already" in result.err
    assert (place / "fleet.yaml").read_text() == before
    assert not (place / "secrets.yaml").exists()


def test_secrets_that_are_there_are_kept(fleet, place):
    (place / "fleet.yaml").unlink()
    (place / "secrets.yaml").write_text("a: b\n")
    assert fleet("init", "--json").json == {"written": ["fleet.yaml"]}
    assert (place / "secrets.yaml").read_text() == "a: b\n"


def test_a_folder_that_cannot_be_written_is_reported(fleet, place):
    (place / "file").write_text("")
    result = fleet("init", "file/new")
    assert result.code == 1
    assert "Traceback" not in result.err


def test_the_example_of_the_project_is_what_init_writes():
    packaged = resources.files("fleet.cli").joinpath("example.yaml").read_text(encoding="utf-8")
    assert (ROOT / "fleet.yaml").read_text(encoding="utf-8") == packaged


def test_the_example_of_the_project_passes_the_check(fleet):
    result = fleet("check", str(ROOT / "fleet.yaml"))
    assert (result.code, result.err) == (0, "")
