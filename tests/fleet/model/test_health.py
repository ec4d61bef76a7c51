import itertools

from hypothesis import given
from hypothesis import strategies as st

from fleet.model.health import Health, Level, worst

HEALTHS = st.lists(st.builds(Health, st.sampled_from(Level), st.text(max_size=3)), max_size=6)


def test_the_levels_are_ordered_from_good_to_bad_and_named_in_lower_case():
    assert [level.word for level in sorted(Level)] == ["ok", "degraded", "offline", "fault"]


@given(HEALTHS)
def test_the_worst_is_one_of_them_and_none_is_worse(healths):
    found = worst(healths)
    assert found in healths or (not healths and found == Health())
    assert all(health.level <= found.level for health in healths)


def test_of_equally_bad_ones_the_first_is_reported():
    one, other = Health(Level.OFFLINE, "no heartbeat"), Health(Level.OFFLINE, "no port")
    for healths in itertools.permutations([Health(), one, other]):
        assert worst(healths) is next(health for health in healths if health.level is Level.OFFLINE)


def test_nothing_at_all_is_ok():
    assert worst([]) == Health(Level.OK, "")
