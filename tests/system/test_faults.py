"""A bad network between edge and broker: nothing is lost silently, done twice, or done late."""

import json
import time

import pytest

from tests.tools.command_client import PUPPETS, CommandClient, counted, executed
from tests.tools.promises import Rules, What, broken
from tests.tools.proxy import TcpProxy
from tests.tools.waiting import wait_until

TWINS = {f"puppet-{n}": f"6f0c9a1e-3b1d-4c52-9b7e-0a4f5d6c7c{n:02d}" for n in range(4)}
SLACK = 0.9  # s of a busy computer between the check of an age and the journal; less than what comes too late
COMMANDS = Rules(max_age=5.0 + SLACK, gate=What.RECEIVED, replies=False)
VELOCITIES = Rules(max_age=0.5 + SLACK, gate=What.EXECUTED, once=False, replies=False)


class Storm:
    """Puppets at one end of a proxy, and somebody who asks at the broker; what counts is from now on."""

    def __init__(self, running, proxy, client, journal):
        self.running, self.proxy, self.client, self.journal = running, proxy, client, journal
        self._before = len(client.requests)
        self.accepted_before = proxy.accepted

    def answered(self, *, every=1.0):
        """Ask again until everything is answered."""
        last = time.monotonic()

        def done():
            nonlocal last
            if self.client.unanswered() and time.monotonic() - last > every:
                last = time.monotonic()
                self.client.retry_until_accepted()
            return not self.client.unanswered()

        wait_until("all answers", done)

    def requests(self):
        """Return by number what this test has asked."""
        return {number: each for number, each in self.client.requests.items() if number > self._before}

    def events(self):
        """Return what became of it: here, and at the puppets."""
        here = [event for event in self.client.events() if int(event.request) > self._before]
        return [*here, *self.executed()]

    def executed(self):
        return executed(self.journal, self.requests())


@pytest.fixture(scope="module")
def puppets(request, shared_fleet, tmp_path_factory):
    """Run four puppets behind a proxy, in one process, for all tests of a broker."""
    port = request.getfixturevalue(request.param).port
    folder = tmp_path_factory.mktemp("puppets")
    journal = folder / "journal"
    common = {"adapter": "puppet", "worker": "main", "rate": 5, "joints": 2, "journal": str(journal)}
    robots = [{"name": name, "twin": twin, **common} for name, twin in TWINS.items()]
    with TcpProxy(port) as proxy:
        cloud = {"host": "127.0.0.1", "port": proxy.port, "tls": False, "keepalive": 2}
        edge = {"id": f"yard-{request.param}"}
        file = {"edge": edge, "cloud": cloud, "plugins": [str(PUPPETS)], "robots": robots}
        (folder / "fleet.yaml").write_text(json.dumps(file))
        running = shared_fleet("run", "--json", folder=folder)
        for name in TWINS:
            running.robot(name, "is well", lambda state: state["health"] == "ok")
        client = CommandClient(port, TWINS)
        yield running, proxy, client, journal
        client.close()


@pytest.fixture
def storm(puppets):
    """Wait until the puppets answer."""
    storm = Storm(*puppets)
    storm.client.request("puppet-0")
    storm.answered()
    return storm


@pytest.mark.parametrize("puppets", ["shared_broker", "shared_foreign_broker"], indirect=True)
def test_in_a_storm_of_resets_every_command_is_done_once_and_answered(storm):
    for turn in range(8):
        for number, name in enumerate(TWINS):
            storm.client.request(name, "poke" if turn % 3 else "lunge")
            if number == turn % 4:
                storm.proxy.reset()
        storm.answered(every=0.2)
    assert counted(storm.executed()) == {str(number): 1 for number in storm.requests()}
    assert broken(storm.events(), COMMANDS) == []
    assert storm.proxy.accepted - storm.accepted_before > 4


@pytest.mark.parametrize("puppets", ["shared_broker"], indirect=True)
def test_no_velocity_is_obeyed_that_was_long_under_way_and_fresh_ones_are(storm):
    storm.client.request("puppet-1")  # from now on it knows the sender's clock
    storm.answered()
    storm.proxy.delay = 1.5  # longer than a velocity lives: all of these come too late
    for _ in range(10):
        storm.client.drive("puppet-1")
    last = storm.client.request("puppet-1")
    storm.answered(every=10.0)
    assert str(last.number) in counted(storm.executed())
    assert [event for event in storm.executed() if event.moves] == []
    storm.proxy.delay = 0.0

    def obeyed():
        storm.client.drive("puppet-1")
        return [event for event in storm.executed() if event.moves]

    moved = wait_until("a fresh velocity is obeyed", obeyed)
    assert [line for line in broken(moved, VELOCITIES) if "stale" in line] == []


@pytest.mark.parametrize("puppets", ["shared_broker"], indirect=True)
def test_a_silent_network_is_noticed_and_what_it_swallowed_is_done_once_when_asked_again(storm):
    def losses():
        return sum("cloud disconnected" in line for line in list(storm.running.errors))

    before = losses()
    storm.proxy.blackhole = True
    lost = [storm.client.request(name) for name in TWINS]
    wait_until("the edge misses its broker", lambda: losses() > before)
    storm.proxy.blackhole = False
    storm.answered(every=0.2)
    fresh = [storm.client.request(name) for name in TWINS]
    storm.answered()
    counts = counted(storm.executed())
    assert [counts[str(request.number)] for request in fresh] == [1, 1, 1, 1]
    assert all(counts.get(str(request.number), 0) <= 1 for request in lost)
