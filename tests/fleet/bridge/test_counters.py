from fleet.bridge.counters import LATENCY_BUCKETS, ClassCounts, Latencies
from fleet.wire.rules import TrafficClass


def test_each_class_is_counted_on_its_own():
    counts = ClassCounts()
    for traffic in (TrafficClass.EVENT, TrafficClass.EVENT, TrafficClass.STREAM):
        counts.add(traffic)
    assert counts.by_class() == {"reply": 0, "status": 0, "event": 2, "latest": 0, "stream": 1}
    assert (counts.total, counts.durable) == (3, 2)


def test_a_histogram_counts_what_took_no_longer_than_each_bound():
    latencies = Latencies()
    for seconds in (0.0005, 0.001, 0.03, 99.0):
        latencies.add(seconds)
    buckets = dict(latencies.buckets())
    assert (buckets["0.001"], buckets["0.05"], buckets["5"], buckets["+Inf"]) == (2, 3, 3, 4)
    assert len(buckets) == len(LATENCY_BUCKETS) + 1
    assert (latencies.count, round(latencies.total, 4)) == (4, 99.0315)
