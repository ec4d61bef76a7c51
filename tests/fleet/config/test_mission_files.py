"""A route is read from its file when the mission is; a run has its own copy of it."""

import json

import pytest

from fleet.config.missions import KnownNames, mission_of, read_mission
from fleet.config.problems import InvalidConfig
from fleet.missions.runs import digest_of

MISSION = """
version: 1
roles: {feet: {count: {min: 1, max: 2}}}
steps:
  - {id: round, do: {feet: {path: %s}}}
"""
LINE = {"type": "LineString", "coordinates": [[8.5, 47.3], [8.6, 47.4, 12]]}


@pytest.fixture
def mission(tmp_path):
    """Write a mission whose path is as said, and the files of that; gives what reads it."""

    def mission(path, **files):
        for name, content in files.items():
            (tmp_path / name.replace("_", ".")).write_text(content)
        (tmp_path / "patrol.yaml").write_text(MISSION % path)
        return read_mission(tmp_path / "patrol.yaml", {}, KnownNames())

    return mission


def acts(mission):
    return [act.value for act in mission.program({}).steps[0].acts["feet"]]


@pytest.mark.parametrize(
    ("files", "name", "points"),
    [
        ({"way_yaml": "- [0, 1]\n- [2, 3, 4]\n- {lat: 47.3, lon: 8.5}"}, "way.yaml", None),
        ({"way_csv": "x,y\n0,1\n2,3\n"}, "way.csv", [[0.0, 1.0], [2.0, 3.0]]),
        ({"way_csv": "latitude,longitude\n47.3,8.5\n"}, "way.csv", [{"lat": 47.3, "lon": 8.5}]),
        (
            {"way_json": json.dumps(LINE)},
            "way.json",
            [{"lat": 47.3, "lon": 8.5}, {"lat": 47.4, "lon": 8.6, "alt": 12.0}],
        ),
    ],
)
def test_a_route_may_be_yaml_csv_or_geojson(mission, files, name, points):
    expected = points or [[0, 1], [2, 3, 4], {"lat": 47.3, "lon": 8.5}]
    assert acts(mission(name, **files)) == [expected]


def test_a_list_of_files_has_one_for_each_robot(mission):
    found = mission("[a.csv, [[5, 6], [7, 8]]]", a_csv="0,1\n2,3\n")
    assert acts(found) == [[[0.0, 1.0], [2.0, 3.0]], [[5, 6], [7, 8]]]


def test_what_is_in_the_file_is_sent_along_and_part_of_the_hash(mission):
    first = mission("way.csv", way_csv="0,1\n2,3\n")
    again = mission("way.csv", way_csv="0,1\n2,4\n")
    hashes = {digest_of(each.program({}), {"feet": ["a"]}) for each in (first, again)}
    assert len(hashes) == 2
    assert acts(mission_of("patrol", first.data)) == acts(first)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("- [0, 1]\n- [2]\n", r"way.yaml:2:3: .*a point is \[x, y\]"),
        ("- [0, 1]\n- {lat: 95, lon: 1}\n", r"way.yaml:2:3: .*lat and lon are degrees"),
        ("- [0, 1", r"way.yaml:\d+:"),
        ("7", r"patrol.yaml:5:35: .*way.yaml: is no list of 1 to 500 points"),
        ("[]", r"patrol.yaml:5:35: .*way.yaml: is no list of 1 to 500 points"),
        (None, r"patrol.yaml:5:35: .*way.yaml: No such file"),
    ],
)
def test_what_is_wrong_with_a_route_is_reported_with_its_place(mission, content, problem):
    with pytest.raises(InvalidConfig, match=problem):
        mission("way.yaml", **({} if content is None else {"way_yaml": content}))
