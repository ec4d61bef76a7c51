"""Who has which places: never more than fit, nobody waits for ever, and no wait is for who waits himself."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from fleet.model.occupancy import Claim, ClaimVerdict, Occupancy, SettledClaim

NAMES = ("dock", "gate", "pad", "yard")
HOLDERS = tuple(f"run-{number}" for number in range(6))


def granted(*holders):
    return [SettledClaim(holder, ClaimVerdict.GRANTED) for holder in holders]


def test_a_place_is_had_by_as_many_as_fit_and_the_next_waits_until_one_gives_it_back():
    places = Occupancy({"dock": 2})
    assert places.request("a", {"dock": 1}, now=0.0, within=10.0) == granted("a")
    assert places.request("b", {"dock": 1}, now=0.0, within=10.0) == granted("b")
    assert places.request("c", {"dock": 1}, now=0.0, within=10.0) == []
    assert places.held("dock") == {"a": 1, "b": 1}
    assert places.release_places("a", now=1.0) == granted("c")
    assert places.held("dock") == {"b": 1, "c": 1}


def test_who_waits_too_long_gives_up_what_it_has_and_learns_who_had_the_rest():
    places = Occupancy({"dock": 1, "pad": 1})
    places.request("a", {"pad": 1}, now=0.0, within=5.0)
    assert places.request("b", {"dock": 1, "pad": 1}, now=0.0, within=5.0) == []
    assert places.held("dock") == {"b": 1}
    assert places.request("c", {"dock": 1}, now=1.0, within=60.0) == []
    assert places.next_end() == 5.0
    assert places.settle(now=4.9) == []
    assert places.settle(now=5.0) == [SettledClaim("b", ClaimVerdict.LATE, "pad", ("a",)), *granted("c")]


def test_who_asked_first_for_a_place_has_it_first_though_less_would_do_for_another():
    places = Occupancy({"yard": 2})
    places.request("a", {"yard": 1}, now=0.0, within=9.0)
    assert places.request("both", {"yard": 2}, now=0.0, within=9.0) == []
    assert places.request("one", {"yard": 1}, now=0.0, within=9.0) == []
    assert places.release_places("a", now=1.0) == granted("both")
    assert places.release_places("both", now=2.0) == granted("one")


def test_two_that_want_the_same_places_the_other_way_round_do_not_wait_for_each_other():
    places = Occupancy({"dock": 1, "pad": 1})
    assert places.request("a", {"pad": 1, "dock": 1}, now=0.0, within=9.0) == granted("a")
    assert places.request("b", {"dock": 1, "pad": 1}, now=0.0, within=9.0) == []
    assert places.release_places("a", now=1.0) == granted("b")


@pytest.mark.parametrize(
    ("wanted", "expected"),
    [
        ({"nowhere": 1}, "there is no place 'nowhere'"),
        ({"dock": 2}, "dock has room for 1, not for 2"),
        ({"dock": 0}, "dock has room for 1, not for 0"),
    ],
)
def test_what_nobody_could_ever_have_is_refused(wanted, expected):
    places = Occupancy({"dock": 1})
    assert places.trouble(wanted) == expected
    with pytest.raises(ValueError, match=expected):
        places.request("a", wanted, now=0.0, within=1.0)
    assert places.claims == []


def test_a_holder_asks_once_for_all():
    places = Occupancy({"dock": 1, "pad": 1})
    places.request("a", {"pad": 1}, now=0.0, within=1.0)
    with pytest.raises(ValueError, match="asked already"):
        places.request("a", {"dock": 1}, now=0.0, within=1.0)


def test_it_goes_on_from_what_was_kept_of_it():
    kept = [Claim("a", (("dock", 1),), 5.0, taken=1), Claim("b", (("dock", 1),), 50.0)]
    places = Occupancy({"dock": 1}, kept)
    assert places.held("dock") == {"a": 1}
    assert places.release_places("a", now=9.0) == granted("b")


class Runs(RuleBasedStateMachine):
    """Holders ask, wait, are late and give back in any order."""

    @initialize(capacities=st.fixed_dictionaries({name: st.integers(1, 3) for name in NAMES}))
    def begin(self, capacities):
        self.capacities, self.places, self.now = capacities, Occupancy(capacities), 0.0
        self.waiting, self.having = {}, {}

    def take(self, settled):
        for each in settled:
            wanted = self.waiting.pop(each.holder)
            if each.verdict is ClaimVerdict.GRANTED:
                self.having[each.holder] = wanted

    @rule(holder=st.sampled_from(HOLDERS), data=st.data(), within=st.floats(0.1, 20.0))
    def request(self, holder, data, within):
        if holder in self.waiting or holder in self.having:
            return
        names = data.draw(st.sets(st.sampled_from(NAMES), min_size=1))
        wanted = {name: data.draw(st.integers(1, self.capacities[name])) for name in names}
        self.waiting[holder] = wanted
        self.take(self.places.request(holder, wanted, now=self.now, within=within))

    @precondition(lambda self: self.having)
    @rule(data=st.data())
    def end(self, data):
        holder = data.draw(st.sampled_from(sorted(self.having)))
        del self.having[holder]
        self.take(self.places.release_places(holder, now=self.now))

    @precondition(lambda self: self.waiting)
    @rule(data=st.data())
    def give_up(self, data):
        holder = data.draw(st.sampled_from(sorted(self.waiting)))
        del self.waiting[holder]
        self.take(self.places.release_places(holder, now=self.now))

    @rule(seconds=st.floats(0.0, 5.0))
    def wait(self, seconds):
        self.now += seconds
        self.take(self.places.settle(now=self.now))

    @precondition(lambda self: self.waiting)
    @rule()
    def wait_until_one_is_late(self):
        """Let another holder ask for the same places before."""
        late = min((claim for claim in self.places.claims if claim.next), key=lambda claim: claim.until)
        for holder in sorted(set(HOLDERS) - {*self.waiting, *self.having})[:1]:
            self.waiting[holder] = dict(late.wanted)
            self.take(self.places.request(holder, self.waiting[holder], now=self.now, within=20.0))
        self.now = self.places.next_end()
        self.take(self.places.settle(now=self.now))

    @rule()
    def restart(self):
        self.places = Occupancy(self.capacities, self.places.claims)

    @invariant()
    def never_more_than_fit(self):
        for name, capacity in self.capacities.items():
            assert sum(self.places.held(name).values()) <= capacity

    @invariant()
    def who_was_granted_has_all_it_wants(self):
        for holder, wanted in self.having.items():
            assert all(self.places.held(name).get(holder) == number for name, number in wanted.items())

    @invariant()
    def nobody_waits_when_nobody_has_anything(self):
        assert not self.waiting or self.having

    @invariant()
    def nobody_waits_for_a_place_that_is_free(self):
        awaited = set()
        for claim in self.places.claims:
            if claim.next is None:
                continue
            place, number = claim.next
            if place not in awaited:  # the first in the queue of this place
                assert sum(self.places.held(place).values()) + number > self.capacities[place]
            awaited.add(place)

    @invariant()
    def who_waits_has_not_been_granted(self):
        assert {claim.holder for claim in self.places.claims if claim.next} == self.waiting.keys()

    @invariant()
    def nobody_waits_longer_than_it_said(self):
        end = self.places.next_end()
        assert end is None or end > self.now

    def teardown(self):
        """End all that have their places, again and again: in the end nobody waits."""
        while getattr(self, "having", None):
            self.end_one(next(iter(self.having)))
        assert not getattr(self, "waiting", None)

    def end_one(self, holder):
        del self.having[holder]
        self.take(self.places.release_places(holder, now=self.now))


TestRuns = Runs.TestCase
TestRuns.settings = settings(max_examples=200, stateful_step_count=40, deadline=None)
