"""The map of topics is made from the tables, and holds all of them."""

import pathlib
import runpy

import pytest

from fleet.wire.rulebook import PROFILES
from fleet.wire.rules import CHANNEL_SUFFIXES, INWARD, RULES

DOCS = pathlib.Path(__file__).parents[2] / "docs" / "reference"


@pytest.fixture(scope="module")
def text():
    return (DOCS / "topics.md").read_text(encoding="utf-8")


def test_the_map_of_topics_is_up_to_date(text):
    made = runpy.run_path(str(DOCS / "make_topics_reference.py"))["render"]()
    assert text == made, "run: python docs/reference/make_topics_reference.py"


@pytest.mark.parametrize("rule", RULES.values(), ids=lambda rule: rule.suffix)
def test_every_topic_is_on_the_map_with_its_qos(text, rule):
    rows = [line for line in text.splitlines() if f"| {rule.about}{' (off)' * (not rule.on)} |" in line]
    assert len(rows) == 1
    assert f"| {rule.traffic.word} | {rule.qos} | {rule.max_rate or '-'} |" in rows[0]


@pytest.mark.parametrize("rule", INWARD.values(), ids=lambda rule: rule.suffix)
def test_every_topic_from_the_cloud_is_on_the_map_with_where_it_goes(text, rule):
    rows = [line for line in text.splitlines() if f"| {rule.about}{' (off)' * (not rule.on)} |" in line]
    assert len(rows) == 1
    assert f"| {rule.qos} | {rule.max_rate or '-'} |" in rows[0]
    assert rule.channel in rows[0]


@pytest.mark.parametrize("profile", PROFILES)
def test_every_profile_is_a_column(text, profile):
    assert f" `{profile}` |" in text


@pytest.mark.parametrize("channel", CHANNEL_SUFFIXES)
def test_every_channel_of_the_bus_is_on_the_map(text, channel):
    assert f"| `cw/{{twin}}/data/{channel}" in text
