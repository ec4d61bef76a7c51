"""Which sessions a message goes to, and which messages wait for subscribers."""

import mqtt5
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.cloud.topics import matches
from fleet.sim.broker import subscription_directory
from fleet.sim.broker.limits import ClientLimits
from fleet.sim.broker.session import BrokerSession, BrokerSubscription
from fleet.sim.broker.subscription_directory import RetainedMessage, SubscriptionDirectory

LIMITS = ClientLimits(retained=2, retained_bytes=10)
levels = st.sampled_from(["a", "b", "", "$x"])
topics = st.lists(levels, min_size=1, max_size=3).map("/".join)
filters = st.lists(st.sampled_from(["a", "b", "+"]), min_size=1, max_size=3).map("/".join) | st.sampled_from(
    ["#", "a/#", "+/#", "$x/#"]
)


def subscription(pattern, qos=0, identifier=None):
    return BrokerSubscription(mqtt5.TopicFilter(pattern, max_qos=mqtt5.QoS(qos)), identifier)


def message(topic, payload=b"x", deadline=None):
    return RetainedMessage(mqtt5.PublishPacket(topic, payload, retain=True), deadline)


@pytest.fixture
def store():
    return SubscriptionDirectory(LIMITS)


@pytest.fixture
def join(store):
    """Return the maker of a session with subscriptions."""

    def join(name, *patterns):
        session = BrokerSession(name, LIMITS)
        store.add(session)
        for pattern in patterns:
            store.subscribe(session, subscription(pattern))
        return session

    return join


def receivers(store, topic):
    return {
        session.client_id: [one.options.pattern for one in wanted] for session, wanted in store.match(topic)
    }


@given(st.lists(st.lists(filters, max_size=3), max_size=3), st.lists(topics, max_size=5))
def test_a_message_goes_to_each_session_with_all_its_matching_subscriptions(wanted, published):
    store = SubscriptionDirectory(LIMITS)
    for number, patterns in enumerate(wanted):
        session = BrokerSession(str(number), LIMITS)
        store.add(session)
        for pattern in patterns:
            store.subscribe(session, subscription(pattern))
    for topic in (*published, *published):  # the second time from memory
        expected = {
            str(number): sorted({pattern for pattern in patterns if matches(pattern, topic)})
            for number, patterns in enumerate(wanted)
        }
        found = {name: sorted(patterns) for name, patterns in receivers(store, topic).items()}
        assert found == {name: patterns for name, patterns in expected.items() if patterns}


def test_what_is_known_of_a_topic_follows_every_change(store, join):
    ann = join("ann", "a")
    assert receivers(store, "a") == {"ann": ["a"]}
    bob = join("bob", "+")
    assert receivers(store, "a") == {"ann": ["a"], "bob": ["+"]}
    assert store.unsubscribe(ann, "a")
    assert receivers(store, "a") == {"bob": ["+"]}
    store.remove(bob)
    assert receivers(store, "a") == {}
    join("ann", "a")
    assert receivers(store, "a") == {"ann": ["a"]}


def test_a_new_session_of_a_client_is_in_place_of_the_old_one(store, join):
    join("ann", "a")
    assert receivers(store, "a") == {"ann": ["a"]}
    new = join("ann")
    assert (receivers(store, "a"), store.sessions) == ({}, {"ann": new})


def test_a_second_subscription_to_a_filter_replaces_the_first_and_is_not_new(store, join):
    ann = join("ann")
    first, second = subscription("a", 0, 1), subscription("a", 2, 2)
    assert (store.subscribe(ann, first), store.subscribe(ann, second)) == (True, False)
    assert store.match("a") == [(ann, [second])]


def test_an_unsubscription_says_whether_there_was_one(store, join):
    ann = join("ann", "a")
    assert [store.unsubscribe(ann, pattern) for pattern in ("b", "a", "a")] == [False, True, False]


def test_topics_without_end_are_not_remembered_without_end(store, join, monkeypatch):
    monkeypatch.setattr(subscription_directory, "_REMEMBERED", 3)
    join("ann", "#")
    for number in range(10):
        assert receivers(store, str(number)) == {"ann": ["#"]}
        assert len(store._matches) <= 3


def kept(store, pattern="#", now=0.0):
    return [(one.packet.topic, one.packet.payload) for one in store.retained(pattern, now)]


def test_the_last_message_of_a_topic_is_retained_and_an_empty_one_clears_it(store):
    for payload in (b"1", b"2"):
        store.retain(message("a", payload))
    store.retain(message("b"))
    assert kept(store) == [("a", b"2"), ("b", b"x")]
    assert kept(store, "b") == [("b", b"x")]
    store.retain(message("a", b""))
    assert kept(store) == [("b", b"x")]


@pytest.mark.parametrize(("now", "found"), [(4.9, True), (5.0, False), (6.0, False)])
def test_a_message_is_retained_until_it_expires(store, now, found):
    store.retain(message("a", deadline=5.0))
    assert bool(kept(store, now=now)) is found


def test_a_full_store_takes_no_new_topic_and_still_replaces_and_clears_those_it_has(store):
    for topic in ("a", "b", "c"):
        store.retain(message(topic, b"1"))
    assert kept(store) == [("a", b"1"), ("b", b"1")]
    store.retain(message("a", b"2"))
    assert sorted(kept(store)) == [("a", b"2"), ("b", b"1")]
    store.retain(message("b", b""))
    store.retain(message("c", b"1"))
    assert sorted(kept(store)) == [("a", b"2"), ("c", b"1")]


@pytest.mark.parametrize(("size", "found"), [(6, True), (7, False)])
def test_the_bytes_of_what_is_retained_are_bounded_and_given_back(store, size, found):
    store.retain(message("b", b"1234567890"))
    store.retain(message("b", b""))
    store.retain(message("a", b"1234"))
    store.retain(message("b", bytes(size)))
    assert (len(kept(store)) == 2) is found


def test_a_message_that_has_no_room_takes_the_one_before_with_it(store):
    """The topic has a newer value: the old one must not pass for it."""
    store.retain(message("a", b"1"))
    store.retain(message("a", bytes(11)))
    assert kept(store) == []
