"""Reading the places that a robot is led through."""

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.config.route import Waypoints, read_route, route_of
from fleet.errors import Refused

LINE = {"type": "LineString", "coordinates": [[8.5, 47.1, 20], [8.6, 47.2, 25]]}
ON_EARTH = ((47.1, 8.5, 20.0), (47.2, 8.6, 25.0))


def points(line):
    return [{"type": "Point", "coordinates": each} for each in line["coordinates"]]


def features(shapes):
    return {"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": one} for one in shapes]}


def test_numbers_are_one_place_and_groups_of_them_are_several():
    assert route_of(["1", "-2"]) == Waypoints(((1.0, -2.0),))
    assert route_of(["1", "2", "3"]) == Waypoints(((1.0, 2.0, 3.0),))
    assert route_of(["1,2", "-3,4,5"]) == Waypoints(((1.0, 2.0), (-3.0, 4.0, 5.0)))


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["1"], "the place: two or three numbers are needed, these are 1"),
        (["1", "2", "3", "4"], "these are 4"),
        (["1,2", "x,3"], "place 2: 'x' is no number"),
        (["1,2", "3"], "place 2: two or three"),
        (["nan", "1"], "'nan' is no number"),
        (["inf,1"], "'inf' is no number"),
    ],
)
def test_what_is_no_place_is_refused_with_where_it_stands(words, why):
    with pytest.raises(Refused, match=why):
        route_of(words)


@pytest.mark.parametrize(
    ("text", "route"),
    [
        ("1,2\n\n3, 4\n", Waypoints(((1.0, 2.0), (3.0, 4.0)))),
        ("x,y,z\n1,2,3\n", Waypoints(((1.0, 2.0, 3.0),))),
        ("\ufeffLatitude,Longitude,Altitude\n47.1,8.5,20\n47.2,8.6,25\n", Waypoints(ON_EARTH, geo=True)),
    ],
)
def test_csv_is_metres_unless_its_heading_says_earth(tmp_path, text, route):
    file = tmp_path / "round.csv"
    file.write_text(text)
    assert read_route(file) == route


@pytest.mark.parametrize(
    "document",
    [
        LINE,
        {"type": "Feature", "geometry": LINE, "properties": {"name": "round"}},
        features([LINE]),
        features(points(LINE)),
    ],
)
def test_geojson_has_longitude_first(tmp_path, document):
    file = tmp_path / "round.geojson"
    file.write_text(json.dumps(document))
    assert read_route(file) == Waypoints(ON_EARTH, geo=True)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "there is no place in it"),
        ("x,y\n", "there is no place in it"),
        ("east,north\n1,2\n", "line 1: the columns are"),
        ("1,2\n3,four\n", "line 2: 'four' is no number"),
        ("{", "is no JSON"),
        ("{" + "[" * 100_000, "is no JSON"),
        (json.dumps(features([LINE, LINE])), "2 LineStrings"),
        (json.dumps(features([LINE, *points(LINE)])), "1 LineStrings and 2 Points"),
        (json.dumps({"type": "LineString", "coordinates": [[1]]}), "coordinates are not"),
        (json.dumps({"type": "LineString", "coordinates": "here"}), "coordinates are not"),
        (json.dumps({"type": "Point", "coordinates": [True, 1]}), "'True' is no number"),
        ("1,2\n" * 600_000, "is larger than 1 MiB"),
    ],
)
def test_a_file_that_is_no_path_is_refused_by_its_name(tmp_path, text, why):
    file = tmp_path / "round.csv"
    file.write_text(text)
    with pytest.raises(Refused, match=why) as refused:
        read_route(file)
    assert str(file) in refused.value.reason


@given(st.binary(max_size=60) | st.text(max_size=60).map(str.encode))
def test_whatever_is_in_a_file_it_is_a_path_or_refused(tmp_path_factory, data):
    file = tmp_path_factory.getbasetemp() / "any.csv"
    file.write_bytes(data)
    with contextlib.suppress(Refused):
        assert read_route(file).places
