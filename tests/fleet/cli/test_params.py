import json
import struct

import pytest

from fleet.model.command import Reply, ReplyStatus

VALUES = {"FS_GCS_ENABLE": 0, "GUID_TIMEOUT": 3.0, "RTL_ALT": 1500, "WPNAV_SPEED": 0.1}


@pytest.fixture
def kestrel(play_edge):
    """Let the robot kestrel answer a command with some data."""
    edge = play_edge("yard-1", robots={"kestrel": {"health": "ok"}})

    def kestrel(data):
        return edge.answers("kestrel", Reply("get_parameters", ReplyStatus.ACCEPTED, done=True, data=data))

    return kestrel


def test_parameters_are_shown_by_name(fleet, kestrel):
    requested = kestrel({"GUID_TIMEOUT": 3.0, "WPNAV_SPEED": struct.unpack("<f", struct.pack("<f", 0.1))[0]})
    result = fleet("params", "kestrel", "get", "GUID_TIMEOUT", "WPNAV_SPEED")
    assert (result.code, result.out) == (0, "GUID_TIMEOUT 3\nWPNAV_SPEED 0.1\n")
    assert json.loads(requested[0].payload)["data"] == {"names": ["GUID_TIMEOUT", "WPNAV_SPEED"]}


def test_a_parameter_is_set_and_what_it_was_is_shown(fleet, kestrel):
    requested = kestrel({"name": "RTL_ALT", "before": 1500, "after": -1})
    result = fleet("params", "kestrel", "set", "RTL_ALT", "-1")
    assert (result.code, result.out) == (0, "RTL_ALT -1 (was 1500)\n")
    assert json.loads(requested[0].payload)["data"] == {"name": "RTL_ALT", "value": -1.0, "force": False}


def test_what_is_no_number_is_not_set(fleet, kestrel):
    requested = kestrel({})
    assert fleet("params", "kestrel", "set", "RTL_ALT", "nan").code == 2
    assert requested == []


def test_a_backup_differs_in_nothing_from_its_robot(fleet, kestrel, place):
    kestrel(VALUES)
    assert fleet("params", "kestrel", "backup", "all.param").out == "all.param: 4 parameters\n"
    result = fleet("params", "kestrel", "diff", "all.param")
    assert (result.code, result.out, result.err) == (0, "", "0 differences; 0 only on kestrel\n")
    assert "exists" in fleet("params", "kestrel", "backup", "all.param").err


def test_a_file_that_cannot_be_read_is_reported_in_one_line(fleet, kestrel, place):
    (place / "latin.param").write_bytes(b"\xff\xfe")
    for name, said in (("none.param", "No such file or directory"), ("latin.param", "not UTF-8 text")):
        result = fleet("params", "kestrel", "diff", name)
        assert (result.code, result.err.count("\n")) == (3, 1)
        assert name in result.err
        assert said in result.err
        assert "Errno" not in result.err


def test_differences_are_shown_whatever_wrote_the_file(fleet, kestrel, place):
    kestrel(VALUES)
    (place / "other.param").write_text(
        "# made elsewhere\n1\t1\tRTL_ALT\t1200\t6\nGONE,2.5\nGUID_TIMEOUT 3.0\n"
    )
    result = fleet("params", "kestrel", "diff", "other.param", "--json")
    assert result.code == 7
    assert result.json["differ"] == {
        "GONE": {"file": 2.5, "robot": None},
        "RTL_ALT": {"file": 1200.0, "robot": 1500.0},
    }
    assert result.json["only_robot"] == ["FS_GCS_ENABLE", "WPNAV_SPEED"]


def test_a_line_that_cannot_be_read_is_named(fleet, kestrel, place):
    (place / "bad.param").write_text("RTL_ALT 1500\nRTL_ALT much\n")
    result = fleet("params", "kestrel", "diff", "bad.param")
    assert result.code == 3
    assert "bad.param:2" in result.err


@pytest.fixture
def birds(play_edge):
    """Play a group of which one robot has no parameters; returns what the other is asked."""
    edge = play_edge("yard-1", robots={"kestrel": {}, "rex": {}}, groups={"birds": ["kestrel", "rex"]})
    edge.answers("rex", Reply("get_parameters", ReplyStatus.REJECTED, "rex has no 'get_parameters'"))

    def birds(data):
        return edge.answers("kestrel", Reply("get_parameters", ReplyStatus.ACCEPTED, done=True, data=data))

    return birds


def test_parameters_of_a_group_are_shown_by_robot_and_who_has_none_is_reported(fleet, birds):
    birds({"RTL_ALT": 1500})
    result = fleet("params", "birds", "get", "RTL_ALT")
    assert result.code == 7
    rows = [line.split() for line in result.out.splitlines()]
    assert rows == [["ROBOT", "PARAMETER", "VALUE"], ["kestrel", "RTL_ALT", "1500"]]
    assert "rex has no 'get_parameters'" in result.err


def test_a_parameter_of_a_group_is_set_in_every_robot(fleet, birds):
    requested = birds({"name": "RTL_ALT", "before": 1500, "after": 20})
    result = fleet("params", "birds", "set", "RTL_ALT", "20")
    assert (result.code, result.out) == (7, "kestrel: RTL_ALT 20 (was 1500)\n")
    assert json.loads(requested[0].payload)["command"] == "set_parameter"
