from fleet.cloud.reconnect_backoff import Backoff


def test_waits_double_up_to_the_longest_and_vary_by_half():
    backoff = Backoff(1.0, 5.0)
    for longest in (1.0, 2.0, 4.0, 5.0, 5.0):
        assert longest / 2 <= backoff.wait() <= longest


def test_only_a_success_that_lasts_begins_again_with_the_first_wait():
    backoff = Backoff(1.0, 8.0)
    for _ in range(5):
        backoff.wait()
    backoff.note(7.9)
    assert backoff.wait() >= 4.0
    backoff.note(8.1)
    assert backoff.wait() <= 1.0


def test_two_edges_do_not_come_back_in_step():
    one, other = Backoff(1.0, 1.0), Backoff(1.0, 1.0)
    assert [one.wait() for _ in range(8)] != [other.wait() for _ in range(8)]
