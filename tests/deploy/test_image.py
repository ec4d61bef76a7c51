"""The recipe of the image and its compose file: no rights, nothing writable but the state, a health check."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]

USER = "990"


@pytest.fixture
def recipe():
    return (ROOT / "deploy/oci/Containerfile").read_text()


@pytest.fixture
def service():
    return yaml.safe_load((ROOT / "deploy/oci/compose.yaml").read_text())["services"]["edge"]


def test_the_image_runs_as_a_user_without_rights(recipe):
    assert re.findall(r"^USER (.+)$", recipe, re.MULTILINE) == [USER]
    assert f"--uid {USER}" in recipe


def test_the_container_has_no_capability_and_a_root_that_cannot_be_written(service):
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert service["read_only"] is True
    assert "privileged" not in service
    assert [each for each in service["volumes"] if not each.endswith(":ro")] == ["state:/var/lib/fleet"]


def test_both_have_the_same_health_check(recipe, service):
    command = re.search(r"HEALTHCHECK[^[]+CMD (\[.+\])", recipe).group(1)
    assert service["healthcheck"]["test"] == ["CMD", *yaml.safe_load(command)]


def test_the_sockets_of_the_edge_belong_to_its_user(service):
    assert f"/run/fleet:uid={USER},mode=0750" in service["tmpfs"]


def test_the_build_sees_only_what_the_wheel_is_made_of():
    ignored = (ROOT / ".dockerignore").read_text().splitlines()
    seen = {line[1:] for line in ignored if line.startswith("!")}
    assert "*" in ignored
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    parts = {path.split("/")[0] for path in project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]}
    assert seen == parts | {"LICENSE", "README.md", "pyproject.toml", "uv.lock"}
