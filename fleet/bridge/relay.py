"""Documents from the cloud to programs on the bus: checked, and bounded in size and rate."""

from __future__ import annotations

from collections.abc import Callable

from fleet.clock import Clock
from fleet.cloud.values import CloudMessage
from fleet.errors import WireError
from fleet.runtime.rate_limited_counter import RateLimitedCounter
from fleet.wire.documents import document_in, is_for_the_cloud, is_state_of_another, word_of_update
from fleet.wire.rules import ENVIRONMENT, InboundRule
from fleet.wire.topics import Topic, data_key

Put = Callable[[str, bytes], None]
MOST_ALLOWANCES = 10_000  # of UUIDs and topics; workflow runs keep adding new ones


class Relay:
    """Forwards documents from the cloud to the bus. On the loop only."""

    def __init__(self, put: Put, refusals: RateLimitedCounter, clock: Clock) -> None:
        self._put = put
        self._refusals = refusals
        self._clock = clock
        self._allowances: dict[tuple[str, str], tuple[float, float]] = {}  # tokens left, last update
        self.passed = 0

    def forward(self, topic: Topic, rule: InboundRule, message: CloudMessage) -> None:
        """Check one message and publish it on the bus, or count why it is refused."""
        if is_for_the_cloud(topic.suffix, message.payload) or is_state_of_another(
            topic.suffix, message.payload
        ):
            return
        if not self._allowed(topic, rule):
            line = "%s arrives more than %g times a second"
            self._refusals.add("too often", line, message.topic, rule.max_rate)
            return
        try:
            sample = document_in(topic.suffix, message.payload, size=rule.size, now=self._clock.time())
            key = _key(topic, rule)
        except WireError as error:
            self._refusals.add("unreadable", "a message on %s was not forwarded: %s", message.topic, error)
            return
        self.passed += 1
        self._put(key, sample)

    def _allowed(self, topic: Topic, rule: InboundRule) -> bool:
        """Return False above the rate; the messages of one second may arrive as a burst."""
        if not rule.max_rate:
            return True
        now = self._clock.monotonic()
        place = (topic.twin, topic.suffix)
        burst = max(rule.max_rate, 1.0)
        left, since = self._allowances.get(place, (burst, now))
        left = min(burst, left + (now - since) * rule.max_rate)
        if len(self._allowances) > MOST_ALLOWANCES:
            self._allowances.clear()
        self._allowances[place] = (left - 1.0 if left >= 1.0 else left, now)
        return left >= 1.0


def _key(topic: Topic, rule: InboundRule) -> str:
    """Return the bus key of a message; the type of an update takes the place of the sensor."""
    sensor = word_of_update(topic.suffix.partition(":")[2]) if rule.suffix == ENVIRONMENT else None
    return data_key(topic.twin, rule.channel, sensor)
