"""Reports of a robot: their channels, and which categories of figures are sent."""

from typing import get_args

import pytest

from fleet.model.report import MetricsReport, Report

KINDS = get_args(Report)


def test_every_kind_of_report_has_a_channel_of_its_own():
    assert len({kind.channel for kind in KINDS}) == len(KINDS)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_every_report_is_frozen_and_begins_with_its_stamp(kind):
    assert kind.__struct_config__.frozen
    assert kind.__struct_fields__[0] == "stamp"


def test_figures_without_content_are_only_an_empty_list_of_errors_which_clears_earlier_ones():
    assert MetricsReport(1.0).categories == {"errors": ()}


@pytest.mark.parametrize(
    ("given", "categories"),
    [
        ({"errors": None}, {}),
        ({"errors": None, "power": {"volts": 12.0}}, {"power": {"volts": 12.0}}),
        ({"errors": None, "navigation": {"speed": 0.0}}, {"navigation": {"speed": 0.0}}),
        ({"errors": ({"code": 1},)}, {"errors": ({"code": 1},)}),
        ({"errors": None, "more": {"fan": 5, "empty": {}}}, {"fan": 5, "empty": {}}),
        ({"errors": (), "power": {}, "navigation": {}, "more": {}}, {"errors": ()}),
    ],
)
def test_only_categories_with_content_are_sent(given, categories):
    assert MetricsReport(1.0, **given).categories == categories


def test_a_category_of_the_robot_is_not_replaced_by_one_of_its_name_in_more():
    report = MetricsReport(
        1.0, power={"volts": 12.0}, errors=(), more={"power": 1, "errors": 2, "navigation": 3}
    )
    assert report.categories == {"power": {"volts": 12.0}, "errors": (), "navigation": 3}
    assert report.more == {"power": 1, "errors": 2, "navigation": 3}
