import math
from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import Meta
from pydantic import Field

from fleet.commands import BadDeclaration, Range, arguments, command, commands_of
from fleet.errors import Refused
from fleet.model.navigation import Progress


class Base:
    @command("land", safe=True, timeout=60.0)
    async def land(self):
        """Land here.

        More words.
        """

    @command("takeoff", "lift_off", timeout=30.0)
    async def takeoff(self, *, altitude: float | None = None):
        yield Progress(1.0)

    @command("set_mode", moves=False)
    async def set_mode(self, mode: str, slot: int = 3):
        """Change the mode."""

    async def helper(self, anything):
        """Not a command."""


class Derived(Base):
    @command("land", timeout=5.0)
    async def land(self):
        """Land otherwise."""


SPECS = commands_of(Base)


def test_marked_methods_are_commands_and_others_are_not():
    assert set(SPECS) == {"land", "takeoff", "lift_off", "set_mode"}


def test_a_spec_says_what_was_declared():
    land, mode = SPECS["land"], SPECS["set_mode"]
    assert (land.method, land.timeout, land.safe, land.moves) == ("land", 60.0, True, True)
    assert (mode.timeout, mode.safe, mode.moves) == (10.0, False, False)
    assert land.summary == "Land here."


def test_an_alias_is_the_same_command_under_its_own_name():
    assert SPECS["lift_off"].name == "lift_off"
    assert SPECS["lift_off"].method == SPECS["takeoff"].method == "takeoff"


def test_a_generator_streams_and_a_coroutine_does_not():
    assert SPECS["takeoff"].streams
    assert not SPECS["land"].streams


def test_a_subclass_replaces_the_command_of_its_base():
    assert commands_of(Derived)["land"].timeout == 5.0
    assert commands_of(Base)["land"].timeout == 60.0


def test_an_override_without_a_mark_is_no_command_any_more():
    class Mute(Base):
        async def land(self):
            """Do not offer it."""

    assert "land" not in commands_of(Mute)


def test_arguments_are_the_data_and_the_defaults():
    assert arguments(SPECS["set_mode"], {"mode": "auto"}) == {"mode": "auto", "slot": 3}
    assert arguments(SPECS["takeoff"], {}) == {"altitude": None}
    assert arguments(SPECS["takeoff"], {"altitude": 2}) == {"altitude": 2.0}


@given(st.dictionaries(st.text(max_size=4), st.none() | st.integers() | st.text(max_size=3), max_size=4))
def test_nothing_in_its_data_keeps_a_landing_from_happening(data):
    assert arguments(SPECS["land"], data) == {}


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("takeoff", {"altitude": "2"}, "altitude must be a number, not text"),
        ("takeoff", {"altitude": True}, "altitude must be a number, not true or false"),
        ("set_mode", {}, "mode is missing"),
        ("set_mode", {"mode": 5}, "mode must be text, not a whole number"),
        ("set_mode", {"mode": "auto", "slot": 1.5}, "slot must be a whole number"),
        ("set_mode", {"mode": None}, "mode must be text, not nothing"),
    ],
)
def test_a_wrong_or_missing_field_is_refused_by_name(name, data, reason):
    with pytest.raises(Refused, match=reason) as refusal:
        arguments(SPECS[name], data)
    assert name in str(refusal.value)


def test_a_misspelt_field_is_refused_with_the_one_that_was_meant():
    with pytest.raises(Refused, match=r"takes no 'altitud'.*did you mean 'altitude'"):
        arguments(SPECS["takeoff"], {"altitud": 2})


def test_an_unknown_field_is_refused_with_those_that_are_known():
    with pytest.raises(Refused, match="it takes mode, slot"):
        arguments(SPECS["set_mode"], {"mode": "a", "zzz": 1})


class Arm:
    @command("reach")
    async def reach(
        self,
        *,
        height: Annotated[float, Range(0.1, 2, "m")],
        turn: Annotated[float, Range(-90, 90, "degrees")] | None = None,
        lamps: Annotated[list[int], Range(0, 255, "of 255")] | None = None,
        free: float = 0.0,
    ):
        """Reach."""

    @command("fold")
    async def fold(self):
        """Fold."""

    @command("look", moves=False)
    async def look(self):
        """Look."""


ARM = commands_of(Arm)


def test_text_where_a_number_belongs_is_refused_with_the_range_and_unit():
    with pytest.raises(Refused, match=r"height must be a number, not text \(0.1 to 2 m\)"):
        arguments(ARM["reach"], {"height": "1m"})


def test_a_command_tells_the_ranges_and_units_of_its_numbers():
    ranges = {name: str(bounds) for name, bounds in ARM["reach"].ranges.items()}
    assert ranges == {"height": "0.1 to 2 m", "turn": "-90 to 90 degrees", "lamps": "0 to 255 of 255"}
    with pytest.raises(Refused, match=r"it takes height \(0.1 to 2 m\), turn \(-90 to 90 degrees\)"):
        arguments(ARM["reach"], {"zzz": 1})


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ({"height": 0.0}, "reach: height must be 0.1 to 2 m, not 0"),
        ({"height": 1, "turn": -90.1}, "turn must be -90 to 90 degrees, not -90.1"),
        ({"height": 1, "lamps": [3, 300]}, "lamps must be 0 to 255 of 255, not 300"),
        ({"height": math.nan}, "height must be 0.1 to 2 m, not nan"),
        ({"height": 1, "free": math.inf}, "free must be a finite number"),
    ],
)
def test_a_number_out_of_its_range_is_refused_with_the_range(data, reason):
    with pytest.raises(Refused, match=reason):
        arguments(ARM["reach"], data)


def test_numbers_at_the_ends_of_a_range_are_taken():
    taken = arguments(ARM["reach"], {"height": 2, "turn": -90, "lamps": [0, 255]})
    assert taken == {"height": 2.0, "turn": -90.0, "lamps": [0, 255], "free": 0.0}


def test_data_for_a_command_that_takes_none_is_refused_when_it_would_move_the_robot():
    with pytest.raises(Refused, match=r"fold takes no 'height'.*it takes no data"):
        arguments(ARM["fold"], {"height": 1})
    assert arguments(ARM["look"], {"height": 1}) == {}


# -- bounds of other libraries, and declarations that cannot be used ----------------------------------


class Horn:
    @command("horn")
    async def horn(
        self,
        *,
        seconds: Annotated[float, Meta(ge=1, le=30, extra={"unit": "s"})],
        volume: Annotated[int, Meta(gt=0)] | None = None,
        tone: Annotated[str, Meta(max_length=3)] = "a",
    ):
        """Sound the horn."""


HORN = commands_of(Horn)["horn"]


def test_bounds_by_msgspecs_meta_are_shown():
    ranges = {name: str(bounds) for name, bounds in HORN.ranges.items()}
    assert ranges == {"seconds": "1 to 30 s", "volume": "at least 0"}


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ({"seconds": 0.5}, "horn: seconds must be 1 to 30 s"),
        ({"seconds": 31}, "horn: seconds must be 1 to 30 s"),
        ({"seconds": math.nan}, "seconds must be 1 to 30 s"),
        ({"seconds": 2, "volume": 0}, "volume must be at least 0"),
        ({"seconds": 2, "tone": "abcd"}, "tone"),
    ],
)
def test_bounds_by_msgspecs_meta_are_enforced(data, reason):
    with pytest.raises(Refused, match=reason):
        arguments(HORN, data)


@pytest.mark.parametrize("timeout", ["5", 0, -1.0, math.nan, math.inf, None, True])
def test_a_timeout_that_is_no_time_is_reported_with_its_place(timeout):
    class Bad:
        @command("go", timeout=timeout)
        async def go(self): ...

    with pytest.raises(BadDeclaration, match=rf"timeout must be .* s, not {timeout!r} \(.*test_commands.py"):
        commands_of(Bad)


def declares(annotations, signature="self, *, far"):
    """Return a class whose command has these annotations."""
    names = {"command": command, "Annotated": Annotated, "Field": Field, "object": object}
    exec(f"class Bad:\n    @command('go')\n    async def go({signature}): ...\n", names)
    names["Bad"].go.__annotations__ = annotations
    return names["Bad"]


@pytest.mark.parametrize(
    ("annotations", "signature", "reason"),
    [
        ({}, "self, *, far", "far has no type; write it like far: Annotated"),
        ({"far": Annotated[float, Field(ge=1)]}, "self, *, far", r"far: FieldInfo.* is not enforced here"),
        ({"far": object()}, "self, *, far", "must be a plain type"),
        ({"far": Horn}, "self, *, far", "far must be a plain type"),
        ({"far": "NoSuchName"}, "self, *, far", "annotations cannot be resolved: name 'NoSuchName'"),
        ({"far": float}, "self, *far", "cannot be given by name"),
        ({"far": float}, "self, **far", "cannot be given by name"),
        ({"far": float}, "self, far, /", "cannot be given by name"),
        (
            {"far": Annotated[float, Range(3200, 1500, "rpm")]},
            "self, *, far",
            "far: its Range begins at 3200",
        ),
        ({"far": Annotated[float, Range(0, math.nan, "m")]}, "self, *, far", "and ends at nan"),
        ({"far": Annotated[float, Meta(ge=2, le=1)]}, "self, *, far", "begins at 2 and ends at 1"),
        (
            {"far": Annotated[float, Range(1, 2, "m")]},
            "self, *, far=5",
            "default would be refused: far must be 1 to 2 m, not 5",
        ),
        (
            {"far": Annotated[float, Meta(ge=1)]},
            "self, *, far=0",
            "default would be refused: far must be at least 1",
        ),
        ({"far": float}, "self, *, far='5'", "default would be refused: far must be a number, not text"),
        (
            {"far": float},
            "self, *, far=float('nan')",
            "default would be refused: far must be a finite number",
        ),
        (
            {"far": int},
            "self, *, far=None",
            "default would be refused: far must be a whole number, not nothing",
        ),
    ],
)
def test_a_declaration_that_cannot_be_used_is_reported_with_its_place(annotations, signature, reason):
    with pytest.raises(BadDeclaration, match=reason) as error:
        commands_of(declares(annotations, signature))
    assert "command method go: " in str(error.value)
    assert str(error.value).endswith("(<string>:2)")
