"""Tests of one group run in one process: robots in real time one after another, and who shares an edge."""

import pytest

GROUP = "kept together"


@pytest.mark.xdist_group(GROUP)
def test_the_name_of_a_group_is_where_the_scheduler_looks_for_it(request):
    alone = not hasattr(request.config, "workerinput")  # one process, without pytest-xdist
    assert alone or request.node.nodeid.endswith(f"@{GROUP}")


def test_a_process_gets_a_group_or_else_a_whole_file(module_at):
    kind = module_at("tiers.py").FileScheduling
    scope = object.__new__(kind)._split_scope
    assert scope(f"tests/test_a.py::test_one[x@y]@{GROUP}") == GROUP
    assert scope("tests/test_a.py::TestIt::test_one[x@y::z]") == "tests/test_a.py"
