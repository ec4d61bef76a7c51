"""The figures of a spool: what waits of each class, where, and since when."""

import pytest

from fleet.spool.memory_buffer import DURABLE
from fleet.spool.message import Outgoing
from fleet.spool.statistics import ClassStatistics, class_statistics
from fleet.spool.topic_queue import TopicQueue
from fleet.wire.rules import TrafficClass

REPLY, STATUS, EVENT = TrafficClass.REPLY, TrafficClass.STATUS, TrafficClass.EVENT


def queue(*, memory=(), back=(), on_disk=0, oldest=0, traffic=EVENT):
    """Return a queue with messages in memory that were queued at these Unix times."""
    made = TopicQueue("t", traffic)
    made.memory.extend(message(time) for time in memory)
    made.back.extend(message(time) for time in back)
    made.on_disk, made.oldest_on_disk = on_disk, oldest * 1_000_000
    return made


def message(time):
    return Outgoing("t", b"four", 1, seq=time * 1_000_000)


def figures(*queues, traffic=EVENT):
    return class_statistics(queues)[traffic]


def test_every_durable_class_has_figures_also_when_nothing_waits():
    assert class_statistics([]) == dict.fromkeys(DURABLE, ClassStatistics(0, 0, 0, None))


def test_an_empty_topic_adds_nothing():
    assert figures(queue()) == ClassStatistics(0, 0, 0, None)


def test_messages_in_memory_are_counted_with_the_bytes_of_their_payloads():
    assert figures(queue(memory=[7, 8], back=[5])) == ClassStatistics(3, 0, 12, 5.0)


def test_messages_on_disk_only_are_counted_and_take_no_memory():
    assert figures(queue(on_disk=40, oldest=3)) == ClassStatistics(40, 40, 0, 3.0)


def test_messages_in_memory_are_older_than_those_of_their_topic_on_disk_only():
    assert figures(queue(memory=[6], on_disk=2, oldest=9)) == ClassStatistics(3, 2, 4, 6.0)


def test_gone_messages_count_no_more():
    topic = queue(memory=[6, 7], back=[5])
    topic.back[0].gone = topic.memory[0].gone = True
    assert figures(topic) == ClassStatistics(1, 0, 4, 7.0)
    topic.memory[1].gone = True
    assert figures(topic) == ClassStatistics(0, 0, 0, None)


@pytest.mark.parametrize("order", [1, -1])
def test_the_topics_of_a_class_are_added_up_and_the_oldest_of_all_counts(order):
    topics = [queue(memory=[8]), queue(on_disk=5, oldest=4), queue(), queue(memory=[6])]
    assert figures(*topics[::order]) == ClassStatistics(7, 5, 8, 4.0)


def test_each_class_is_counted_apart():
    found = class_statistics([queue(memory=[8], traffic=STATUS), queue(on_disk=1, oldest=2, traffic=REPLY)])
    assert [(each.messages, each.oldest) for each in found.values()] == [(1, 2.0), (1, 8.0), (0, None)]


def test_the_time_of_a_message_has_its_fractions_of_a_second():
    topic = queue()
    topic.memory.append(Outgoing("t", b"", 1, seq=1_795_386_999_250_000))
    assert figures(topic).oldest == 1_795_386_999.25
