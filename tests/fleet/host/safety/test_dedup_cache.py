"""A repeated ask gets its first answer."""

from fleet.host.safety.dedup_cache import KEPT, LIFETIME, DedupCache


def test_a_repeat_is_known_and_gets_the_first_answer():
    repeats = DedupCache()
    assert repeats.first("a", "the first answer", 0.0) is None
    assert repeats.first("a", "another", 1.0) == "the first answer"


def test_a_message_without_an_id_is_never_a_repeat():
    repeats = DedupCache()
    assert repeats.first("", "an answer", 0.0) is None
    assert repeats.first("", "an answer", 0.0) is None


def test_repeats_are_forgotten_after_their_lifetime_and_beyond_their_number():
    repeats = DedupCache()
    repeats.first("old", "answer", 0.0)
    for number in range(KEPT):
        repeats.first(str(number), "answer", LIFETIME + 1)
    assert repeats.first("old", "answer", LIFETIME + 1) is None
    assert len(repeats._seen) <= KEPT
