import pytest

from fleet.config.json_schema import DIALECT, json_schema
from fleet.plugins.registry import Registry

OTHER = """
from collections.abc import Callable
from typing import Literal
from fleet import AdapterConfig, FrameAdapter

class OtherConfig(AdapterConfig):
    adapter: Literal["other"]
    link: str
    wheels: int = 4

class Other(FrameAdapter[OtherConfig]):
    Config = OtherConfig
    def decode(self, frame, stamp): return ()
    def halt(self): return (b"",)
"""


@pytest.fixture
def schema(yard):
    yard.write(OTHER, "plugins/other.py")
    registry = Registry(yard.installed)
    registry.add_folder(yard.folder / "plugins")
    return json_schema(registry)


def references(part):
    """Return every $ref under a part of a schema."""
    parts = part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
    own = [part["$ref"]] if isinstance(part, dict) and "$ref" in part else []
    return own + [found for each in parts for found in references(each)]


def test_it_names_its_dialect_and_all_references_resolve(schema):
    assert schema["$schema"] == DIALECT
    assert {ref.removeprefix("#/$defs/") for ref in references(schema)} <= set(schema["$defs"])


def test_a_robot_is_one_of_the_kinds_by_its_adapter(schema):
    robots = schema["properties"]["robots"]["items"]
    assert robots["discriminator"]["propertyName"] == "adapter"
    kinds = [schema["$defs"][each["$ref"].rpartition("/")[2]] for each in robots["oneOf"]]
    assert [kind["properties"]["adapter"]["const"] for kind in kinds] == ["other", "toy"]
    assert all(kind["required"] == ["name", "twin", "adapter"] for kind in kinds)


def test_unknown_keys_are_refused_and_x_keys_allowed(schema):
    assert schema["additionalProperties"] is False
    assert schema["patternProperties"] == {"^x-": {}}


def test_defaults_may_hold_what_some_robot_may_hold(schema):
    properties = schema["properties"]["defaults"]["properties"]
    assert {"limits", "accepts", "link", "wheels", "armed"} <= set(properties)
    assert not {"name", "twin", "adapter"} & set(properties)


def test_a_variable_may_stand_for_a_number(schema):
    port = schema["$defs"]["CloudConfig"]["properties"]["port"]
    assert port["anyOf"][1] == {"type": "string", "pattern": r"\$\{"}
    assert port["default"] == 8883


def test_a_duration_may_be_written_with_its_unit_wherever_there_is_one(schema):
    def durations(part):
        patterns = [each.get("pattern", "") for each in part.get("anyOf", ())]
        return any("min|h" in each for each in patterns) or any(map(durations, part.get("anyOf", ())))

    schedule = schema["$defs"]["ScheduleConfig"]["properties"]
    mission = schema["$defs"]["MissionConfig"]["properties"]
    assert [durations(each) for each in (schedule["every"], schedule["late"], mission["deadline"])] == [
        True,
        True,
        True,
    ]


def test_a_fleet_without_adapters_has_a_schema_too():
    assert json_schema(Registry([]))["properties"]["robots"]


def test_a_config_that_cannot_be_described_is_left_out(yard, caplog):
    wheels = "wheels: Callable[[], int] | None = None"
    yard.write(OTHER.replace("wheels: int = 4", wheels), "plugins/other.py")
    registry = Registry([])
    registry.add_folder(yard.folder / "plugins")
    assert "OtherConfig" not in json_schema(registry)["$defs"]
    assert "other is left out of the schema" in caplog.text


def test_a_mission_in_it_is_what_a_mission_file_is(schema):
    missions = schema["properties"]["missions"]["additionalProperties"]
    assert missions == {"$ref": "#/$defs/MissionConfig"}
    assert "steps" in schema["$defs"]["MissionConfig"]["properties"]
