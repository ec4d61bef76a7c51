"""The page that says how far Cyberwave's contract is kept names tests that exist, and gives its reasons."""

import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
PAGE = (TESTS.parent / "docs" / "reference" / "contract.md").read_text(encoding="utf-8")
ROWS = [
    row for row in re.findall(r"^\| (.+?) \| (.+?) \| (.+) \|$", PAGE, re.MULTILINE) if row[0] != "subject"
]
TEST = re.compile(r"`([\w/]+\.py)::(\w+)`")
NAMED = sorted(set(TEST.findall(PAGE)))
PARTS = 157  # rows of the contract: one may be added, none may be left out


def test_every_part_of_the_contract_has_its_row():
    assert len(ROWS) >= PARTS
    assert {verdict for _, verdict, _ in ROWS} == {"works", "partly", "not"}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_what_works_has_a_test_and_what_does_not_a_reason(row):
    _, verdict, why = row
    if verdict == "works":
        assert TEST.search(why)
    else:
        assert len(TEST.sub("", why).split()) > 5


@pytest.mark.parametrize(("file", "name"), NAMED)
def test_a_test_that_the_page_names_exists(file, name):
    assert f"def {name}(" in (TESTS / file).read_text(encoding="utf-8")
