"""The page that says where everything is proved names tests that exist, and leaves nothing out."""

import re
from pathlib import Path

import pytest

from fleet_quadruped.sim.faults import ALL_FAULTS

TESTS = Path(__file__).parents[2]
PAGE = (TESTS.parent / "docs" / "reference" / "quadruped-conformance.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (.+?) \| (.+?) \| (.+?) \|$", PAGE, re.MULTILINE)
PROOFS = sorted(set(re.findall(r"`([\w/]+\.py)::(\w+)`", PAGE)))


def test_every_item_of_the_list_has_its_row():
    assert [row[0] for row in ROWS if row[0].isdigit()] == [str(number) for number in range(1, 35)]


def test_every_row_is_proved_by_a_test_or_a_measurement():
    proved = [row[2] for row in ROWS if row[2] != "proved by"]
    assert all(".py::test_" in cell or "bench" in cell for cell in proved)


@pytest.mark.parametrize(("file", "name"), PROOFS)
def test_the_named_test_exists(file, name):
    assert f"def {name}(" in (TESTS / file).read_text(encoding="utf-8")


@pytest.mark.parametrize("fault", sorted(ALL_FAULTS))
def test_every_fault_of_the_simulator_has_its_row(fault):
    assert any(f"`{fault}`" in row[0] for row in ROWS)
