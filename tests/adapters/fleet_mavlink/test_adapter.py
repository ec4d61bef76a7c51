"""The adapter on top of a session: what it opens, what it refuses by itself, and whom it asks for what."""

import contextlib
from types import SimpleNamespace

import pytest

from fleet import FlyMission, Goal, GoTo, NotReady, Progress, Refused, Vector3, Velocity
from fleet.model.health import Level
from fleet_mavlink import adapter as module
from fleet_mavlink.adapter import MavlinkAdapter
from fleet_mavlink.config import MavlinkConfig

BASICS = {
    "name": "kestrel",
    "twin": "6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1f",
    "adapter": "mavlink",
    "link": "udpin:0.0.0.0:14540",
}
HOME = object()


class Robot:
    """The host's side of an adapter, as far as ``connect`` needs it; ``opened``: what was shared, by key."""

    def __init__(self):
        self.healths, self.opened = [], {}
        self.clock = SimpleNamespace(time=lambda: 1_800_000_000.0)
        self.limits = MavlinkAdapter.limits

    def health(self, health):
        self.healths.append(health)

    def share(self, key, make):
        return self.opened.setdefault(key, make())

    async def enter(self, context):
        return await context.__aenter__()


class Session:
    """A session that answers what a test sets."""

    def __init__(self, *_made_of):
        self.made_of = _made_of
        self.vehicle = SimpleNamespace(
            now=lambda: 0.0,
            state=SimpleNamespace(connected=lambda _now: True, heartbeat=None),
            clashed=lambda _now: False,
            system=1,
        )
        self.asked, self.battery, self.home = [], True, HOME
        self.driver = SimpleNamespace(drive=lambda velocity: self.asked.append(("drive", velocity)))
        self.missions = SimpleNamespace(fly=lambda task: self._progress("mission", task))
        self.navigator = SimpleNamespace(carry_out=lambda task, origin: self._progress("goal", task, origin))

    def origin(self):
        return self.home

    def report_battery(self):
        return self.battery

    async def kill(self):
        self.asked.append("kill")

    async def _progress(self, *what):
        self.asked.append(what)
        for percent in (0.0, 100.0):
            yield Progress(percent)


@pytest.fixture
def made():
    """Make an adapter with a session that is connected."""

    def make(**config):
        adapter = MavlinkAdapter(MavlinkConfig.model_validate(BASICS | config), Robot())
        adapter._session = Session()
        return adapter

    return make


@pytest.fixture
def connected(monkeypatch):
    """Connect an adapter; return it, its robot, and what its hub was opened with."""
    opened = []

    @contextlib.asynccontextmanager
    async def open_hub(urls, clock, system, component):
        opened.append((list(urls), system, component))
        yield SimpleNamespace(
            vehicle=lambda system, signer, **more: contextlib.nullcontext((system, signer, more))
        )

    class SimProcess:
        def __init__(self, name):
            self.name = name

        async def __aenter__(self):
            return self

        @contextlib.asynccontextmanager
        async def robot(self, spec):
            yield f"udpout:127.0.0.1:{15_000 + spec.system_id}"

    async def nothing(*_arguments):
        pass

    for name, value in (("open_hub", open_hub), ("SimProcess", SimProcess), ("VehicleSession", Session)):
        monkeypatch.setattr(module, name, value)
    for name in ("show", "report_traffic"):
        monkeypatch.setattr(module, name, nothing)

    async def connect(**config):
        adapter = MavlinkAdapter(MavlinkConfig.model_validate(BASICS | config), Robot())
        await adapter.connect()
        return adapter, adapter.robot, opened[-1]

    return connect


async def test_before_its_first_heartbeat_it_is_offline_with_what_is_waited_for(connected):
    _, robot, _ = await connected(system_id=7)
    (health,) = robot.healths
    assert health.level is Level.OFFLINE
    assert health.cause == "no heartbeat from system 7 on udpin:0.0.0.0:14540 yet"


async def test_its_link_and_the_ways_beside_it_are_one_hub_with_our_ids(connected):
    links = {"backup_links": ["udpout:10.0.0.5:14550"], "own_system": 240, "own_component": 200}
    _, robot, opened = await connected(**links)
    assert opened == (["udpin:0.0.0.0:14540", "udpout:10.0.0.5:14550"], 240, 200)
    (key,) = robot.opened
    assert key == "mavlink udpin:0.0.0.0:14540 udpout:10.0.0.5:14550 240/200"


@pytest.mark.parametrize(
    "differs", [{"own_system": 244}, {"own_component": 190}, {"link": "udpin:0.0.0.0:14541"}]
)
async def test_robots_share_a_hub_only_with_the_same_links_and_the_same_ids(connected, differs):
    _, one, _ = await connected(system_id=1)
    _, same, _ = await connected(system_id=2)
    _, other, _ = await connected(**differs)
    assert set(one.opened) == set(same.opened)
    assert not set(one.opened) & set(other.opened)


async def test_a_simulated_vehicle_is_started_and_reached_where_it_waits(connected):
    _, robot, opened = await connected(link="sim:px4", system_id=3)
    assert opened[0] == ["udpout:127.0.0.1:15003"]
    assert "fleet_mavlink.sim" in robot.opened


@pytest.mark.parametrize("key", [None, "correct horse battery"])
async def test_a_vehicle_is_claimed_by_its_id_with_a_signer_if_there_is_a_key(connected, key):
    adapter, _, _ = await connected(system_id=9, signing_key=key, accept_unsigned=True)
    system, signer, more = adapter._session.made_of[3]
    assert system == 9
    assert (signer is not None) is (key is not None)
    assert more == {"accept_unsigned": True}


async def test_a_kill_takes_a_config_that_allows_it_and_force(made):
    with pytest.raises(Refused, match="kill is not allowed for this robot") as refused:
        await made().kill(force=True)
    assert "allow_kill: true" in refused.value.hint
    adapter = made(allow_kill=True)
    with pytest.raises(Refused, match="in the air it falls") as refused:
        await adapter.kill()
    assert refused.value.hint == "say force=true"
    assert adapter._session.asked == []
    await adapter.kill(force=True)
    assert adapter._session.asked == ["kill"]


async def test_a_battery_of_which_nothing_is_known_is_not_reported_as_checked(made):
    adapter = made()
    await adapter.battery_check()
    adapter._session.battery = False
    with pytest.raises(NotReady, match="has not said how its battery is"):
        await adapter.battery_check()


async def test_a_battery_of_a_silent_vehicle_is_not_reported_as_checked(made):
    adapter = made()
    adapter._session.vehicle.state.connected = lambda _now: False
    with pytest.raises(NotReady, match="no heartbeat from system 1"):
        await adapter.battery_check()


async def test_goals_and_missions_are_flown_by_their_own_parts_from_home(made):
    adapter, goal, mission = made(), GoTo(Goal(Vector3(1.0, 2.0, 3.0))), FlyMission("out", ())
    for task in (goal, mission):
        assert [step.percent async for step in adapter.navigate(task)] == [0.0, 100.0]
    assert adapter._session.asked == [("goal", goal, HOME), ("mission", mission)]


async def test_nothing_is_flown_while_home_is_unknown(made):
    adapter = made()
    adapter._session.home = None
    for task in (GoTo(Goal(Vector3())), FlyMission("out", ())):
        with pytest.raises(NotReady):
            await anext(adapter.navigate(task))
    assert adapter._session.asked == []


def test_a_velocity_is_the_drivers(made):
    adapter, velocity = made(), Velocity(Vector3(1.0, 0.0, 0.0))
    adapter.drive(velocity)
    assert adapter._session.asked == [("drive", velocity)]


def test_a_replay_reaches_nothing_but_its_link():
    config = MavlinkConfig.model_validate(
        BASICS | {"watchers": [{"link": "udpout:10.0.0.5:14550"}], "traffic": "send"}
    )
    replayed = MavlinkAdapter.replayed(config, Robot())
    assert (replayed.config.watchers, replayed.config.traffic) == ((), "off")
    assert replayed.config.link == config.link
    assert (len(config.watchers), config.traffic) == (1, "send")
