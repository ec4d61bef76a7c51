"""A goal outside the fence of every robot of its role is found by ``fleet check``, with its place."""

import json

import pytest

from fleet.config.load import load
from fleet.config.problems import InvalidConfig

HERE = {"latitude": 47.0, "longitude": 8.0}
NARROW, WIDE = ([[[-r, -r], [r, -r], [r, r], [-r, r]]] for r in (10, 100))
UGV = {"adapter": "ugv", "profile": "waveshare-beast", "origin": HERE}


def fleet(tmp_path, *steps, **more):
    robots = [
        {**UGV, "name": name, "link": f"sim:{UGV['profile']}", "fence": {"inclusion": fence}}
        | {"twin": f"6f0c9a1e-1111-4111-8111-00000000000{number}"}
        for number, (name, fence) in enumerate((("beast", NARROW), ("rover", WIDE)))
    ]
    roles = {"one": {"from": "beast"}, "any": {"from": "yard"}}
    mission = {"version": 1, "inputs": {"x": {"type": "number", "default": 50}}, "roles": roles}
    config = {
        "edge": {"id": "yard-1"},
        "site": {"origin": [47.0, 8.0, 400.0]},
        "robots": robots,
        "groups": {"yard": ["beast", "rover"]},
        "places": {"gate": {"at": [50, 0]}},
        "missions": {"patrol": {**mission, "steps": list(steps)}},
        **more,
    }
    (tmp_path / "fleet.yaml").write_text(json.dumps(config, indent=1))
    return load(tmp_path / "fleet.yaml", {})


@pytest.mark.parametrize(
    "act",
    [{"goto": [50, 0]}, {"goto": "gate"}, {"path": [[1, 1], [50, 0]]}, {"goto": {"lat": 47.01, "lon": 8.0}}],
)
def test_where_no_robot_of_the_role_may_go_is_an_error(tmp_path, act):
    with pytest.raises(
        InvalidConfig, match=r"fleet.yaml:\d+:\d+: .*outside the fence of beast: no robot of the"
    ):
        fleet(tmp_path, {"id": "go", "do": {"one": act}})


def test_where_some_robot_may_not_go_is_a_warning(tmp_path):
    warnings = fleet(tmp_path, {"id": "go", "do": {"any": {"goto": [50, 0]}}}).warnings
    assert any("outside the fence of beast" in each.message for each in warnings if "missions" in each.path)


def test_what_lies_within_or_is_an_input_is_neither(tmp_path):
    steps = (
        {"id": "go", "do": {"one": {"goto": [5, 0]}}},
        {"id": "on", "do": {"one": {"goto": [{"input": "x"}, 0]}}},
    )
    found = fleet(tmp_path, *steps)
    assert not [each for each in found.warnings if "missions" in each.path]


def test_an_event_that_nobody_reports_is_found(tmp_path):
    wait = {"id": "look", "wait_for": {"role": "one", "event": "person_sen", "timeout": "1 min"}}
    with pytest.raises(InvalidConfig, match=r"there is no source of the event 'person_sen'.*person_seen"):
        fleet(tmp_path, wait, events=["person_seen"])
    wait["wait_for"]["event"] = "person_seen"
    assert fleet(tmp_path, wait, events=["person_seen"]).missions
    wait["wait_for"]["event"] = "lost"
    assert fleet(tmp_path, wait).missions


def flown(tmp_path, role, *links, firmware=12, vehicle=2):
    """Load a fleet of MAVLink vehicles, one of which is to fly a plan."""
    item = {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, None, 47.0, 8.0, 9]}
    mission = {"items": [item], "firmwareType": firmware, "vehicleType": vehicle}
    (tmp_path / "field.plan").write_text(json.dumps({"fileType": "Plan", "mission": mission}))
    drones = [
        {"name": name, "adapter": "mavlink", "link": link, "system_id": number}
        | {"twin": f"6f0c9a1e-1111-4111-8111-10000000000{number}"}
        for number, (name, link) in enumerate(zip(("kestrel", "merlin"), links, strict=False), 1)
    ]
    steps = [{"id": "fly", "do": {"eye": {"plan": "field.plan"}}}]
    return fleet(
        tmp_path,
        robots=drones,
        groups={"drones": [drone["name"] for drone in drones]},
        missions={"survey": {"version": 1, "roles": {"eye": role}, "steps": steps}},
        places={},
    )


def test_a_plan_for_another_autopilot_than_the_robots_is_an_error_with_its_place(tmp_path):
    why = r"fleet.yaml:\d+:\d+: .*it was made for px4 multirotor, which kestrel is not: no robot of the role"
    with pytest.raises(InvalidConfig, match=why):
        flown(tmp_path, {}, "sim:ardupilot")


def test_a_plan_for_another_kind_of_vehicle_is_an_error_for_a_real_one_too(tmp_path):
    with pytest.raises(InvalidConfig, match="made for ardupilot submarine, which kestrel is not"):
        flown(tmp_path, {}, "udpin:127.0.0.1:14550", firmware=3, vehicle=12)


def test_a_plan_that_some_robots_of_the_role_do_not_fly_is_a_warning(tmp_path):
    warnings = flown(tmp_path, {}, "sim:px4", "sim:ardupilot").warnings
    assert [each.message for each in warnings if "missions" in each.path] == [
        "it was made for px4 multirotor, which merlin is not"
    ]


@pytest.mark.parametrize("link", ["sim:px4", "udpin:127.0.0.1:14550"])
def test_a_plan_that_the_robot_may_fly_is_fine(tmp_path, link):
    assert not [each for each in flown(tmp_path, {}, link).warnings if "missions" in each.path]
