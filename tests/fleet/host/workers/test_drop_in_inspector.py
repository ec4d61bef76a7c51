"""What a drop-in file has and what it makes of a robot's config, as its own process tells it."""

import json
from collections.abc import Callable
from typing import Literal

import pytest
from pydantic import field_validator

from fleet.adapter import Adapter, AdapterConfig
from fleet.commands import command
from fleet.host.workers.drop_in_inspector import checked, described
from fleet.plugins.drop_in_file import Imported
from fleet.plugins.probe import ConfigCase, Flaw, ProblemPlace
from fleet.robot_config import Limits

REX = {"name": "rex", "twin": "6f0c9a1e-0000-4000-8000-000000000001", "adapter": "toy"}
AT = ("robots", 0)
ROBOT, ARMS = ProblemPlace("fleet.yaml", 7, 5, AT), ProblemPlace("fleet.yaml", 9, 11, (*AT, "arms"))


class ToyConfig(AdapterConfig):
    adapter: Literal["toy"]
    arms: int = 2
    port: str = ""
    link: str = "serial:"

    def identity(self):
        return self.port or None

    @field_validator("port")
    @classmethod
    def _known(cls, port, info):
        if port == "exit":
            raise SystemExit(3)
        if port == "folder":
            return str(info.context["folder"])
        if port == "broken":
            raise RuntimeError("no such port")
        return port


class Toy(Adapter[ToyConfig]):
    Config = ToyConfig
    limits = Limits(speed=2.0, altitude=30.0)
    failsafe = "it moves nothing"

    def halt(self):
        pass

    async def stop(self, reason):
        pass

    @command("wave")
    async def wave(self):
        """Wave an arm."""

    @command("bow")
    async def bow(self):
        """Bow."""


class Driven(Toy):
    def drive(self, velocity):
        pass


class Unsayable(Toy):
    """An adapter whose Config has no JSON Schema."""

    class Config(ToyConfig):
        call: Callable[[], None] = print


IMPORTED = Imported((("toy", Toy),))


def case(at=AT, texts=(), spoiled=(), **fields):
    """Return the case of a robot on line 7; the value of its arms is on line 9, as is the key armz."""
    return ConfigCase(
        adapter="toy",
        data=json.dumps(REX | fields),
        at=at,
        folder="/home/fleet",
        marks=((AT, ROBOT), ((*AT, "arms"), ARMS), ((*AT, "armz"), ROBOT)),
        keys=(((*AT, "arms"), ROBOT), ((*AT, "armz"), ARMS)),
        texts=texts,
        spoiled=spoiled,
    )


def test_an_adapter_is_described_with_its_limits_and_its_commands_by_name():
    toy = described("toy", Toy)
    assert (toy.name, toy.cls, toy.warning) == ("toy", f"{__name__}:Toy", "")
    assert (toy.drives, toy.navigates, toy.limits) == (False, False, {"speed": 2.0, "altitude": 30.0})
    names = [each.name for each in toy.commands]
    assert names == sorted(names)
    assert {"bow", "wave"} <= set(names)


def test_an_adapter_that_drives_says_so():
    assert described("toy", Driven).drives


def test_the_schema_of_a_config_is_left_out_where_it_is_not_wanted_or_there_is_none():
    assert described("toy", Toy).schema["properties"]["arms"]["default"] == 2
    assert described("toy", Toy, schema=False).schema is None
    assert described("toy", Unsayable).schema is None


def test_an_adapter_for_an_older_api_is_described_with_the_warning():
    class Old(Toy):
        api = Toy.api - 1

    assert "was written for version" in described("toy", Old).warning


def test_a_config_is_told_by_what_was_given_and_by_the_fields_that_the_host_knows():
    found = checked(case(arms=3, limits={"speed": 1.0}), IMPORTED)
    assert json.loads(found.given) == REX | {"arms": 3, "limits": {"speed": 1.0}}
    fields = json.loads(found.fields)
    assert (fields["name"], fields["limits"]["speed"], "arms" in fields) == ("rex", 1.0, False)
    assert (found.flaws, found.simulated, found.identity) == ((), False, None)


@pytest.mark.parametrize(
    ("fields", "simulated", "identity"),
    [({"port": "/dev/arm"}, False, "/dev/arm"), ({"link": "sim:toy"}, True, None)],
)
def test_a_config_says_whether_its_robot_is_simulated_and_which_machine_it_is(fields, simulated, identity):
    found = checked(case(**fields), IMPORTED)
    assert (found.simulated, found.identity) == (simulated, identity)


def test_paths_are_relative_to_the_folder_of_the_file():
    assert checked(case(port="folder"), IMPORTED).identity == "/home/fleet"


def test_a_flaw_is_told_at_its_place_in_the_file():
    found = checked(case(arms="many"), IMPORTED)
    assert (found.given, found.fields) == ("", "")
    assert found.flaws == (Flaw(ARMS, "must be a whole number"),)


def test_a_key_that_is_misspelt_is_told_at_the_key():
    found = checked(case(armz=3), IMPORTED)
    assert found.flaws == (Flaw(ARMS, "unknown key", "did you mean 'arms'?"),)


def test_a_text_from_a_variable_may_be_a_number_and_is_given_as_one():
    found = checked(case(arms="3", texts=((*AT, "arms"),)), IMPORTED)
    assert (found.flaws, json.loads(found.given)["arms"]) == ((), 3)
    assert checked(case(arms="3"), IMPORTED).flaws


def test_a_value_that_could_not_be_read_is_not_reported_again():
    found = checked(case(arms="many", spoiled=((*AT, "arms"),)), IMPORTED)
    assert (found.flaws, found.given) == ((), "")


@pytest.mark.parametrize(
    ("port", "text"), [("broken", "RuntimeError: no such port"), ("exit", "SystemExit: 3")]
)
def test_a_config_whose_own_code_fails_is_a_flaw_of_its_robot(port, text):
    found = checked(case(port=port), IMPORTED)
    assert found.flaws == (Flaw(ROBOT, "the adapter 'toy' failed to check it", text),)
    assert found.given == ""


def test_the_flaws_of_one_robot_are_not_those_of_the_next():
    assert checked(case(arms="many"), IMPORTED).flaws
    assert checked(case(), IMPORTED).flaws == ()
