"""Tests of one group run in one process: robots in real time one after another, and who shares an edge."""

from collections import OrderedDict

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


class Process:
    """A process of pytest-xdist, which is given indices of tests."""

    shutting_down = False

    def __init__(self):
        self.given = []

    def send_runtest_some(self, indices):
        self.given += indices

    def shutdown(self):
        self.shutting_down = True


@pytest.fixture
def schedule(module_at):
    """Distribute files among two processes: ``schedule(file, ...)``, one test in each."""

    def schedule(*files):
        tests = [f"{file}::test_it" for file in files]
        scheduler = object.__new__(module_at("tiers.py").FileScheduling)
        first, last = Process(), Process()
        scheduler.log = lambda *_: None
        scheduler.workqueue = OrderedDict((test.partition("::")[0], {test: False}) for test in tests)
        scheduler.assigned_work = {first: {}, last: {}}
        scheduler.registered_collections = {first: tests, last: tests}
        return scheduler, first, last

    return schedule


def test_the_last_process_computes_while_others_wait_for_robots(schedule):
    scheduler, first, last = schedule("tests/system/a.py", "tests/system/b.py", "tests/c.py")
    for process in (last, first, last):
        scheduler._assign_work_unit(process)
    assert (first.given, last.given) == ([0], [2, 1])


def test_a_file_that_is_done_is_not_counted_again(schedule):
    scheduler, first, _ = schedule("tests/a.py", "tests/b.py", "tests/c.py")
    scheduler._assign_work_unit(first)
    scheduler.mark_test_complete(first, 0)
    assert list(scheduler.assigned_work[first]) == ["tests/b.py"]
    assert first.given == [0, 1]
