"""What keeps a robot from being added to a running edge until its next start."""

import json
import uuid

import pytest

from fleet.config.load import load
from fleet.host.edge.member_rules import groups_blocker, membership_refusal

WALL = {"name": "wall", "kind": "serial", "device": "/dev/ttyS9"}
TWINS = {name: str(uuid.uuid4()) for name in ("rex", "ada")}


@pytest.fixture
def loaded(tmp_path):
    def made(*robots, crew=("rex",), worker="", **sections):
        entries = [{"name": name, "twin": TWINS[name], "adapter": "quadruped"} for name in robots]
        place = {"link": "sim:auto"} | ({"worker": worker} if worker else {})
        document = {
            "edge": {"id": "yard"},
            "robots": [entry | place for entry in entries],
            "groups": {"crew": list(crew), "others": list(crew)},
        }
        (tmp_path / "fleet.yaml").write_text(json.dumps(document | sections))
        return load(tmp_path / "fleet.yaml")

    return made


@pytest.mark.parametrize("worker", ["", "limbs"])
@pytest.mark.parametrize("named", ["crew", "ada"])
def test_a_robot_that_a_stop_input_names_by_its_group_or_not_waits_for_the_next_start(loaded, worker, named):
    """The input knows its robots from its start: one that joins would move without it."""
    running = loaded("rex", stop_inputs=[WALL | {"robots": ["crew"]}])
    new = loaded("rex", "ada", crew=("rex", "ada"), worker=worker, stop_inputs=[WALL | {"robots": [named]}])
    assert "a stop input that it needs is opened at the start" in membership_refusal(
        running, new.config, "ada"
    )


def test_a_robot_that_every_stop_input_or_none_stops_is_added(loaded):
    for robots in ({}, {"robots": ["rex"]}, {"robots": ["crew"]}):
        inputs = [WALL | robots]
        running = loaded("rex", stop_inputs=inputs)
        assert membership_refusal(running, loaded("rex", "ada", stop_inputs=inputs).config, "ada") == ""


def test_a_robot_whose_twin_another_robot_still_has_waits(loaded):
    running, new = loaded("rex"), loaded("rex", "ada")
    twin = running.config.robots[0].twin
    others = [robot.model_copy(update={"twin": twin}) for robot in new.config.robots]
    assert "rex has its twin" in membership_refusal(
        running, new.config.model_copy(update={"robots": others}), "ada"
    )


def test_groups_that_a_stop_input_names_wait_for_the_next_start(loaded):
    """It knows the latches that it holds from its start."""
    inputs = {"stop_inputs": [WALL | {"robots": ["crew"]}]}
    running = loaded("rex", "ada", **inputs).config
    assert groups_blocker(running, running) == ""
    new = loaded("rex", "ada", crew=("rex", "ada"), **inputs).config
    assert "stop input wall names one" in groups_blocker(running, new)
