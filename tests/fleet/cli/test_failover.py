"""Which edge ``fleet failover`` means; the handover itself is tests/system/test_standby.py."""

import pytest

from fleet.cli.failover import _holder
from fleet.errors import FleetError
from fleet.model.state import EdgeState


def edges(**roles):
    return [EdgeState(name, "0", 0.0, 0.0, pair=role) for name, role in roles.items()]


def test_the_one_edge_that_has_its_pairs_robots_is_meant():
    assert _holder(edges(a="standby", b="holder", c=""), None) == "b"
    assert _holder(edges(a="holder", b="holder"), "a") == "a"


@pytest.mark.parametrize(
    ("found", "named", "problem"),
    [
        (edges(c=""), None, "no edge of a pair can be reached"),
        (edges(a="standby"), None, "a is standby: ask on the computer of the other edge"),
        (edges(a="holder", b="holder"), None, "say which: a, b"),
        (edges(a="holder"), "z", "no edge z of a pair can be reached"),
    ],
)
def test_anything_else_is_reported(found, named, problem):
    with pytest.raises(FleetError, match=problem):
        _holder(found, named)


def test_where_no_edge_runs_that_is_said(fleet):
    code, _, said = fleet("failover")
    assert (code, "no edge is running here" in said) == (4, True)
