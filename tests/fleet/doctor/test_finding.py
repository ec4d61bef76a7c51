"""The order of findings."""

from fleet.doctor.finding import error, ok, unknown, warning, worst_first


def test_the_worst_comes_first_and_equal_ones_keep_their_order():
    found = worst_first(
        [ok("a", "-"), warning("b", "-", "-"), error("c", "-", "-"), unknown("d", "-"), error("e", "-", "-")]
    )
    assert [each.check for each in found] == ["c", "e", "b", "d", "a"]
