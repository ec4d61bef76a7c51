"""Which stops take a vehicle from whoever has it, and which leave it to its pilot or to its landing."""

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import LinkLost, NotReady, Refused
from fleet_mavlink.stops import StopCommands

TAKES_OVER = ["hover", "brake", "emergency_stop"]
REQUESTED = [*TAKES_OVER, "stop", "pause"]
OWN = st.text(max_size=30).filter(lambda reason: reason not in REQUESTED)  # reasons of the host itself


class Session:
    """A session that notes its stops and halts."""

    def __init__(self, *, is_ours_to_stop=True, error=None):
        self.is_ours_to_stop, self.error, self.log = is_ours_to_stop, error, []
        self.halts = SimpleNamespace(
            halt=lambda **how: self._note(("halt", how)), write=lambda **how: self._note(("write", how))
        )

    async def stop(self, reason, *, takes_over):
        self._note((reason, takes_over))

    def _note(self, what):
        self.log.append(what)
        if self.error is not None:
            raise self.error


def stops(**session):
    """Return the stops of a session."""
    commands = object.__new__(StopCommands)
    commands._session = Session(**session)
    return commands


def run(coroutine):
    """Run what waits for nothing."""
    with pytest.raises(StopIteration):
        coroutine.send(None)


@pytest.mark.parametrize("ours", [True, False])
@pytest.mark.parametrize("reason", REQUESTED)
def test_a_stop_that_somebody_asks_for_is_carried_out_whoever_has_the_vehicle(reason, ours):
    it = stops(is_ours_to_stop=ours)
    run(it.stop(reason))
    assert it._session.log == [(reason, reason in TAKES_OVER)]


@given(OWN, st.booleans())
def test_a_stop_of_the_host_itself_leaves_a_vehicle_that_is_not_ours_alone_and_takes_it_from_nobody(
    reason, ours
):
    it = stops(is_ours_to_stop=ours)
    run(it.stop(reason))
    assert it._session.log == [(reason, False)] * ours


def test_a_link_that_fails_leaves_it_unknown_whether_the_vehicle_stops():
    it = stops(error=LinkLost("the cable is out"))
    with pytest.raises(NotReady, match="it is unknown whether it stops: the cable is out"):
        it.stop("stop").send(None)


def test_a_refusal_of_the_vehicle_is_passed_on():
    it = stops(error=Refused("a pilot has it"))
    with pytest.raises(Refused, match="a pilot has it"):
        it.stop("stop").send(None)


def test_only_an_emergency_halt_takes_the_vehicle_from_whoever_has_it():
    it = stops()
    it.halt()
    it.emergency_halt()
    assert it._session.log == [("halt", {}), ("halt", {"takes_over": True})]


@pytest.mark.parametrize("name", ["halt", "emergency_halt"])
def test_a_halt_on_a_link_that_is_gone_raises_nothing(name):
    it = stops(error=LinkLost("gone"))
    getattr(it, name)()
    assert len(it._session.log) == 1


@pytest.mark.parametrize("reason", REQUESTED)
def test_a_stop_to_a_vehicle_that_is_not_heard_takes_over_as_one_that_is_heard_would(reason):
    it = stops()
    assert it.halt_unheard(reason)
    assert it._session.log == [("write", {"takes_over": reason in TAKES_OVER})]


@pytest.mark.parametrize("error", [LinkLost("gone"), Refused("a pilot has it")])
def test_a_stop_that_was_not_written_is_not_called_written(error):
    with pytest.raises(type(error)):
        stops(error=error).halt_unheard("stop")
