"""Commands for the ground: what they answer, what they refuse, and what JSON could not carry."""

import base64
import json
import math
from types import SimpleNamespace

import pytest

from fleet import NotReady, Progress, Refused
from fleet_mavlink.logs import MOST_BYTES, OnboardLog
from fleet_mavlink.maintenance import UpkeepCommands
from fleet_mavlink.parameters import Parameter


def async_of(value):
    async def call(*_arguments, **_named):
        return value

    return call


def raising(error):
    async def call(*_arguments, **_named):
        raise error

    return call


class Upkeep(UpkeepCommands):
    """The commands of a session of which a test says what it answers."""

    def __init__(self):
        self._session = SimpleNamespace(
            vehicle=SimpleNamespace(state=SimpleNamespace(armed=False)),
            parameters=SimpleNamespace(),
            logs=SimpleNamespace(),
            flight=SimpleNamespace(),
            compass=SimpleNamespace(),
        )

    async def stop(self, reason):
        raise NotImplementedError

    def halt(self):
        raise NotImplementedError


@pytest.fixture
def commands():
    return Upkeep()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
async def test_a_parameter_that_is_no_number_is_answered_as_unknown(commands, value):
    found = [Parameter("A", value, 9), Parameter("B", 2.5, 9), Parameter("C", 7, 6)]
    commands._session.parameters.read = async_of(found)
    answer = await commands.get_parameters(names=["A", "B", "C"])
    assert answer == {"A": None, "B": 2.5, "C": 7}
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer


async def test_without_names_all_parameters_are_read_and_with_none_of_them_none(commands):
    commands._session.parameters.read_all = async_of([Parameter("A", 1.0, 9)])
    commands._session.parameters.read = async_of([])
    assert await commands.get_parameters() == {"A": 1.0}
    assert await commands.get_parameters(names=[]) == {}


async def test_a_parameter_is_written_on_the_ground_and_answered_with_what_it_was(commands):
    commands._session.parameters.write = async_of((Parameter("A", math.nan, 9), Parameter("A", 2.0, 9)))
    assert await commands.set_parameter(name="A", value=2.0) == {"name": "A", "before": None, "after": 2.0}


async def test_a_parameter_is_not_written_while_it_is_armed_unless_by_force(commands):
    commands._session.vehicle.state.armed = True
    commands._session.parameters.write = raising(AssertionError("written"))
    with pytest.raises(Refused, match="it is armed") as refused:
        await commands.set_parameter(name="A", value=2.0)
    assert refused.value.hint == "disarm first, or say force=true"
    commands._session.parameters.write = async_of((Parameter("A", 1, 6), Parameter("A", 2, 6)))
    assert (await commands.set_parameter(name="A", value=2.0, force=True))["after"] == 2


async def test_logs_are_listed_with_their_size_and_time(commands):
    commands._session.logs.list = async_of([OnboardLog(3, 12_345, 1_790_000_000)])
    assert await commands.list_logs() == [{"id": 3, "size": 12_345, "time": 1_790_000_000}]


@pytest.mark.parametrize("data", [b"", b"\x00\xff\x80", bytes(range(256))], ids=len)
async def test_a_part_of_a_log_is_answered_with_where_it_is_and_how_long(commands, data):
    asked = []

    async def read(number, offset, count):
        asked.append((number, offset, count))
        return data

    commands._session.logs.read = read
    answer = await commands.read_log(id=3, offset=90, count=256)
    assert asked == [(3, 90, 256)]
    assert (answer["offset"], answer["count"]) == (90, len(data))
    assert base64.b64decode(answer["data"]) == data


async def test_a_log_is_read_from_its_beginning_in_pieces_of_what_may_be_read(commands):
    asked = []

    async def read(*request):
        asked.append(request)
        return b""

    commands._session.logs.read = read
    await commands.read_log(id=0)
    assert asked == [(0, 0, 32_768)]
    assert asked[0][2] <= MOST_BYTES


async def test_a_check_is_answered_with_the_autopilots_words(commands, monkeypatch):
    def check(name, ok, *words):
        return SimpleNamespace(check=name, ok=ok, words=words)

    found = [check("position", True), check("arming", False, "Compass not calibrated", "Gyros inconsistent")]
    monkeypatch.setattr("fleet_mavlink.maintenance.readiness.inspect", async_of(found))
    answer = await commands.check_ready()
    assert answer["ready"] is False
    assert answer["checks"] == [
        {"check": "position", "ok": True, "words": []},
        {"check": "arming", "ok": False, "words": ["Compass not calibrated", "Gyros inconsistent"]},
    ]
    monkeypatch.setattr("fleet_mavlink.maintenance.readiness.inspect", async_of(found[:1]))
    assert (await commands.check_ready())["ready"] is True


async def test_a_calibration_passes_its_progress_on_and_its_failure(commands):
    async def calibrate():
        yield Progress(10.0)
        yield Progress(100.0)

    commands._session.compass.calibrate = calibrate
    assert [each async for each in commands.start_compass_calibration()] == [Progress(10.0), Progress(100.0)]
    commands._session.compass.stop = raising(Refused("it is armed"))
    with pytest.raises(Refused, match="armed"):
        await commands.stop_compass_calibration()


@pytest.mark.parametrize("command", ["reboot", "setup_signing"])
async def test_a_refusal_of_the_session_is_the_answer(commands, command):
    commands._session.flight.reboot = raising(NotReady("no heartbeat"))
    commands._session.setup_signing = raising(NotReady("no heartbeat"))
    with pytest.raises(NotReady, match="no heartbeat"):
        await getattr(commands, command)()
