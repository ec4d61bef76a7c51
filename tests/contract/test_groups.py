"""Tests of one group run in one process: robots in real time one after another, and who shares an edge."""

import pytest

GROUP = "kept together"


@pytest.mark.xdist_group(GROUP)
def test_the_name_of_a_group_is_where_the_scheduler_looks_for_it(request):
    alone = not hasattr(request.config, "workerinput")  # one process, without pytest-xdist
    assert alone or request.node.nodeid.endswith(f"@{GROUP}")
