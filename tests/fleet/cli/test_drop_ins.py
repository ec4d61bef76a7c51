"""What the command line says of drop-in files, none of which it imports."""

import json

import pytest

from fleet.client.edges import settings_of

LEAVES = "import os\nos._exit(7)\n"


@pytest.fixture
def with_robot(place):
    """Add another robot to the fleet file."""

    def with_robot(**fields):
        text = (place / "fleet.yaml").read_text()
        twin = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12"
        robot = {"name": "max", "twin": twin, "adapter": "toy", "link": "sim:toy"} | fields
        (place / "fleet.yaml").write_text(f"{text}  - {json.dumps(robot)}\n")

    return with_robot


def test_a_file_that_exits_is_one_problem_of_its_robot(fleet, place, with_robot):
    (place / "plugins" / "bad.py").write_text(LEAVES)
    with_robot(adapter="bad")
    result = fleet("check", "--json")
    assert result.code == 3
    (problem,) = result.json["problems"]
    assert problem["path"] == "robots[1].adapter"
    assert problem["hint"] == "its process ended while it was imported (exit code 7)"
    assert problem["message"] == "the adapter 'bad' cannot be used"


def test_all_that_looks_at_plugins_goes_on_beside_a_bad_one(fleet, place):
    (place / "plugins" / "bad.py").write_text(LEAVES)
    assert fleet("check").code == 0
    found = {each["name"]: each["state"] for each in fleet("adapters", "--json").json["adapters"]}
    assert (found["toy"], found["bad"]) == ("loaded", "failed")
    assert "ToyConfig" in json.loads(fleet("schema").out)["$defs"]


def test_a_file_that_others_may_write_is_refused(fleet, place, with_robot):
    path = place / "plugins" / "open.py"
    path.write_text((place / "plugins" / "toy.py").read_text().replace('"toy"', '"open"'))
    path.chmod(0o666)
    with_robot(adapter="open")
    result = fleet("check")
    assert result.code == 3
    assert "others may write it (mode 0666), and so decide what runs here: chmod go-w" in result.err


def test_a_drop_in_file_in_the_edges_own_process_is_reported(fleet, with_robot):
    with_robot(worker="main")
    result = fleet("check")
    assert result.code == 0
    assert "the drop-in file of max runs in the edge's own process" in result.err
    assert "the drop-in file of rex" not in result.err


def test_who_only_wants_the_edges_address_asks_no_plugin(place, monkeypatch):
    monkeypatch.setattr("fleet.plugins.registry.Probe", lambda *_: pytest.fail("a plugin was asked"))
    assert settings_of("fleet.yaml").edge == "yard-1"
