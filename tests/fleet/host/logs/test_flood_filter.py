from fleet.host.logs.flood_filter import MOST, MOST_KINDS, WINDOW, FloodFilter


def test_what_comes_often_is_left_out_and_its_number_is_reported_later():
    flood = FloodFilter()
    admitted = [flood.admit("a", 5.0) for _ in range(MOST + 7)]
    assert admitted == [0] * MOST + [None] * 7
    assert flood.admit("b", 5.0) == 0, "another kind is written"
    assert flood.admit("a", 5.0 + WINDOW) == 7
    assert flood.admit("a", 5.0 + WINDOW) == 0


def test_a_clock_that_is_set_back_leaves_nothing_out_for_long():
    flood = FloodFilter()
    for _ in range(MOST + 1):
        flood.admit("a", 1e9)
    assert flood.admit("a", 5.0) == 1


def test_kinds_without_end_are_bounded():
    flood = FloodFilter()
    admitted = [flood.admit(number, 5.0) for number in range(100_000)]
    assert sum(each is not None for each in admitted) == MOST_KINDS + MOST
