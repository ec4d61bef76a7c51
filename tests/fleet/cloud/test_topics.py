import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.cloud.topics import check_apart, check_filter, check_topic, matches

LEVEL = st.sampled_from(["a", "b", ""])
TOPICS = st.lists(LEVEL, min_size=1, max_size=4).map("/".join).filter(bool)
PATTERNS = st.tuples(
    st.lists(st.sampled_from(["a", "b", "", "+"]), max_size=3), st.sampled_from(["#", "+", "a"])
).map(lambda parts: "/".join([*parts[0], parts[1]]))


@pytest.mark.parametrize(
    ("pattern", "topic", "expected"),
    [
        ("a/b", "a/b", True),
        ("a/b", "a/b/c", False),
        ("a/+/c", "a/b/c", True),
        ("a/+", "a", False),
        ("a/#", "a", True),
        ("a/#", "a/b/c", True),
        ("#", "a//b", True),
        ("+/+", "/a", True),
        ("+", "a/b", False),
        ("#", "$SYS/load", False),
        ("+/load", "$SYS/load", False),
        ("$SYS/#", "$SYS/load", True),
    ],
)
def test_filters_match_as_the_standard_says(pattern, topic, expected):
    assert matches(pattern, topic) is expected


@pytest.mark.parametrize("pattern", ["a/#/b", "a+", "a/b#", "", "a\0", "x" * 70_000, "\ud800"])
def test_a_filter_that_no_broker_takes_is_refused(pattern):
    with pytest.raises(ValueError, match="filter"):
        check_filter(pattern)


@pytest.mark.parametrize("topic", ["a/+", "#", "", "a\0b", "x" * 70_000, "\ud800"])
def test_a_topic_that_cannot_be_published_to_is_refused(topic):
    with pytest.raises(ValueError, match="topic"):
        check_topic(topic)


@given(PATTERNS, PATTERNS, TOPICS)
def test_filters_that_pass_as_apart_never_match_the_same_topic(one, other, topic):
    try:
        check_apart([one, other])
    except ValueError:
        return
    assert not (matches(one, topic) and matches(other, topic))


@pytest.mark.parametrize(
    "patterns", [["a/+", "+/b"], ["a/#", "a"], ["#", "a/b"], ["a/b", "a/+"], ["a/b/c", "a/#"], ["+/#", "a"]]
)
def test_filters_that_overlap_are_refused_by_name(patterns):
    with pytest.raises(ValueError, match="overlap"):
        check_apart(patterns)


def test_ten_thousand_filters_of_many_twins_are_apart():
    leaves = ("command", "navigate/command", "+/extra", "ping")
    check_apart([f"cyberwave/twin/{twin}/{suffix}" for twin in range(2500) for suffix in leaves])


def test_a_shared_subscription_is_refused():
    with pytest.raises(ValueError, match="shared"):
        check_apart(["$share/group/a"])
