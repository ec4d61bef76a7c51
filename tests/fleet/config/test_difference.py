"""Two fleet files to what differs: every robot once, each field in the table, no secret shown."""

import json
from pathlib import PurePath
from uuid import UUID

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.config.difference import (
    FIELDS,
    LIVE_SECTIONS,
    SECTIONS,
    SETTINGS,
    ComparedFile,
    changed,
    difference,
    digest_of,
    flat,
    not_shown,
    outline_of,
    pair_digest,
    renamed,
    shown_by,
)
from fleet.config.load import load
from fleet.config.schema import Sections
from fleet.model.change import ChangeKind
from fleet.robot_config import AdapterConfig

BEAST = {"profile": "waveshare-beast", "link": "sim:waveshare-beast"}
TWIN = "6f0c9a1e-0000-4000-8000-00000000000{}"

fields = st.dictionaries(
    st.sampled_from(["link", "limits.speed", "accepts.command", "worker", "twin", "adapter navigates"]),
    st.sampled_from(["1", "2", '"a"', "true", "false"]),
)
outlines = st.builds(
    ComparedFile,
    edge=st.just("yard"),
    sections=st.dictionaries(st.sampled_from(["cloud", "bus", "places", "not_known_yet"]), fields),
    robots=st.dictionaries(st.sampled_from(["rex", "max", "ada"]), fields),
)


@given(outlines)
def test_the_same_file_differs_in_nothing(one):
    assert {change.kind for change in difference(one, one, not_shown)} <= {ChangeKind.UNTOUCHED}


@given(outlines, outlines)
def test_every_robot_of_either_file_is_reported_once_and_every_section_that_differs(old, new):
    found = difference(old, new, not_shown)
    robots = [change for change in found if not change.section]
    names = [change.name for change in robots]
    assert sorted({*names, *anew(old, new).values()}) == sorted({*old.robots, *new.robots})
    assert len(names) == len(set(names))
    sections = {change.name for change in found if change.section}
    known = {*old.sections, *new.sections}
    assert sections == {name for name in known if old.sections.get(name, {}) != new.sections.get(name, {})}
    assert all(change.why for change in found if change.kind is ChangeKind.RESTART)


def anew(old, new):
    """Return the robots that have another name: new to old."""
    names = renamed(old, new).items()
    return {
        name: was
        for name, was in names
        if name not in old.robots and was not in new.robots and "twin" in new.robots[name]
    }


@given(outlines, outlines)
def test_what_becomes_of_a_robot_follows_from_its_fields_alone(old, new):
    for change in difference(old, new, not_shown):
        if change.section:
            continue
        was, now = old.robots.get(change.name), new.robots.get(change.name)
        expected = ChangeKind.ADDED if was is None else ChangeKind.REMOVED if now is None else None
        if change.name in anew(old, new):
            expected = ChangeKind.RESTART
        if was is not None and now is not None:
            expected = kind_of({name.split(".")[0] for name in changed(was, now)}, was)
        assert change.kind is expected


def kind_of(names, was):
    if not names:
        return ChangeKind.UNTOUCHED
    if names & FIELDS.keys():
        return ChangeKind.RESTART
    led = was.get("adapter navigates") == "true" and names & {"limits", "fence"}
    return ChangeKind.REBUILT if led or names - SETTINGS else ChangeKind.SETTINGS


@given(outlines, outlines)
def test_digests_differ_where_the_values_do_and_show_none(old, new):
    key = b"key"
    plain = [(change.name, change.kind) for change in difference(old, new, not_shown)]
    hidden = difference(old.digest(key), new.digest(key), not_shown)
    assert [(change.name, change.kind) for change in hidden] == plain
    shown = json.dumps([field for change in hidden for field in change.fields])
    assert "->" not in shown


def test_every_section_of_fleet_yaml_has_its_line_in_the_table():
    assert SECTIONS.keys() | LIVE_SECTIONS.keys() == Sections.model_fields.keys() - {"defaults"}
    assert not SECTIONS.keys() & LIVE_SECTIONS.keys()


def test_every_field_in_the_tables_is_one_of_a_robot():
    own = {*AdapterConfig.model_fields, "adapter", "simulated"}
    assert own >= FIELDS.keys() | SETTINGS
    assert not FIELDS.keys() & SETTINGS


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("link", '"tcp:10.0.0.1:5760"', "tcp:10.0.0.1:5760"),
        ("password", '"hunter2hunter2"', "****"),
        ("cloud.token", '"cw_1"', "****"),
        ("link", '"rtsp://user:letmein@camera"', "rtsp://****@camera"),
        ("link", '"udp:kept-in-secrets-yaml"', "udp:****"),
        ("limits.speed", "5.0", "5.0"),
    ],
)
def test_no_secret_is_shown(name, value, shown):
    assert shown_by(["kept-in-secrets-yaml"])(name, value) == shown


def test_a_long_value_is_cut():
    assert len(shown_by([])("link", json.dumps("x" * 500))) == 60


def test_a_robot_of_another_name_is_known_by_its_twin():
    old = ComparedFile("yard", {}, {"rex": {"twin": "1"}, "max": {"twin": "2"}})
    new = ComparedFile("yard", {}, {"ada": {"twin": "1"}, "max": {"twin": "2"}})
    assert renamed(old, new) == {"ada": "rex"}


def test_what_is_left_out_is_what_its_default_says(tmp_path):
    """A field that is written as its default changes nothing; secrets count, and other values are found."""

    def written(**robot):
        entry = {"name": "rex", "twin": TWIN.format(1), "adapter": "ugv", **BEAST} | robot
        fleet = {"edge": {"id": "yard"}, "robots": [entry]}
        (tmp_path / "fleet.yaml").write_text(json.dumps(fleet))
        return outline_of(load(tmp_path / "fleet.yaml", {}))

    plain = written()
    assert plain == written(setpoint_lease=0.5, accepts={})
    (change,) = difference(plain, written(limits={"speed": 0.3}), shown_by([]))
    assert (change.kind, change.fields[0].partition(":")[0]) == (ChangeKind.SETTINGS, "limits.speed")
    (change,) = difference(plain, written(max_age=0.4), shown_by([]))
    assert (change.kind, change.fields) == (ChangeKind.REBUILT, ("max_age: 0.5 -> 0.4",))
    (change,) = difference(plain, written(link="serial:/dev/ttyUSB0?baud=115200"), shown_by([]))
    assert (change.kind, "simulated" in change.why) == (ChangeKind.RESTART, True)


def test_values_of_every_kind_are_flat_text():
    assert flat({"a": {"b": (1, 2.5)}, "c": None, "d": UUID(TWIN.format(1)), "e": frozenset({"y", "x"})}) == {
        "a.b": "[1, 2.5]",
        "d": f'"{TWIN.format(1)}"',
        "e": '["x", "y"]',
    }


def test_it_is_no_difference_how_the_path_of_the_file_was_written(tmp_path, monkeypatch):
    """A unit of systemd names it from the root, a person from the folder in which they are."""
    robot = {"name": "rex", "twin": TWIN.format(1), "adapter": "ugv", **BEAST}
    fleet = {"edge": {"id": "yard"}, "plugins": ["plugins"], "robots": [robot]}
    (tmp_path / "plugins").mkdir()
    (tmp_path / "fleet.yaml").write_text(json.dumps(fleet))

    def outline(file):
        loaded = load(file)
        ((config, plugin),) = loaded.robots
        drop_in = msgspec.structs.replace(plugin, file=loaded.folder / "plugins" / "toy.py")
        loaded = msgspec.structs.replace(loaded, robots=((config, drop_in),))
        return outline_of(loaded), digest_of(loaded)

    whole = outline(tmp_path / "fleet.yaml")
    monkeypatch.chdir(tmp_path)
    assert outline("fleet.yaml") == whole
    monkeypatch.chdir(tmp_path.parent)
    assert outline(f"{tmp_path.name}/fleet.yaml") == whole


def test_the_digest_of_a_pair_leaves_out_what_belongs_to_one_computer():
    def digest(folder="/etc/fleet", edge="a", **robot):
        path = json.dumps(f"{folder}/body.yaml")
        fields = {"link": '"tcp:1"', "password": '"x"', "body": path, "limits.speed": "1.0"} | robot
        sections = {"edge": {"id": json.dumps(edge)}, "cloud": {"token": "1"}, "places": {"gate.at": "[1]"}}
        return pair_digest(ComparedFile(edge, sections, {"rex": fields}), PurePath(folder))

    plain = digest()
    assert plain == digest("/home/fleet", "b", link='"tcp:2"', password='"y"')
    assert plain != digest(**{"limits.speed": "2.0"})
    assert len(plain) == 16
