from fleet.host.runtime.cpu_starvation import REMEMBERED, CpuStarvation


def test_a_process_that_has_the_processor_when_it_wants_it_has_no_problem():
    starvation = CpuStarvation(0.0, 10.0)
    starvation.update(1.0, 10.1)
    assert starvation.problem == ""


def test_a_process_without_a_processor_says_that_the_computer_is_overloaded_and_for_a_while_after():
    starvation = CpuStarvation(0.0, 10.0)
    starvation.update(1.0, 10.63)
    said = "this computer is overloaded: the edge waited 63% of the time for a processor"
    assert starvation.problem == said
    starvation.update(2.0, 10.63)
    assert starvation.problem == said
    starvation.update(1.0 + REMEMBERED, 10.63)
    assert starvation.problem == ""
