"""Paths in a dog's entry of fleet.yaml."""

import pytest
from pydantic import ValidationError

from fleet_quadruped.config import QuadrupedConfig

DOG = {
    "name": "rex",
    "twin": "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f",
    "adapter": "quadruped",
    "link": "sim:auto",
}


def test_a_description_and_the_captures_are_seen_from_the_folder_of_fleet_yaml(tmp_path):
    (tmp_path / "rex.yaml").touch()
    fields = DOG | {"body": "rex.yaml", "captures": "faults"}
    config = QuadrupedConfig.model_validate(fields, context={"folder": tmp_path})
    assert config.body_file == tmp_path / "rex.yaml"
    assert config.captures_folder == tmp_path / "faults"


def test_a_description_that_is_not_there_is_reported_with_where_it_was_looked_for(tmp_path):
    with pytest.raises(ValidationError, match=f"there is no {tmp_path}/rex.yaml"):
        QuadrupedConfig.model_validate(DOG | {"body": "rex.yaml"}, context={"folder": tmp_path})
