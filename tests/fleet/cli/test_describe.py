import msgspec
import pytest

from fleet.bus import keys
from fleet.model.description import CommandDescription, ParameterDescription, RobotDescription

HEIGHT = ParameterDescription("altitude", "number", least=1, most=120, unit="m", required=True)
TAKEOFF = CommandDescription(
    "takeoff", "Climb and hold.", (HEIGHT,), moves=True, timeout=60.0, refusal="emergency stop is set"
)
FOUND = RobotDescription(
    "kestrel",
    "mavlink",
    (TAKEOFF, CommandDescription("land", safe=True, moves=True)),
    drives=True,
    verbs=("move_forward",),
    goals=True,
    missions=True,
    limits={"speed": 5.0},
)


@pytest.fixture
def kestrel(play_edge):
    edge = play_edge("yard-1", robots={"kestrel": {"health": "ok"}, "rex": {"cause": "its worker is silent"}})

    def tell(question):
        question.reply(msgspec.json.encode(FOUND))
        question.close()

    edge.bus.control.declare_queryable(keys.description("yard-1", "kestrel"), tell)


@pytest.mark.usefixtures("kestrel")
def test_all_that_a_robot_takes_is_shown_with_whether_it_would_now_and_why_not(fleet):
    result = fleet("describe", "kestrel")
    assert result.code == 0
    rows = [" ".join(row.split()) for row in result.out.splitlines()]
    assert "takeoff no altitude=NUMBER" in rows
    assert "not now: takeoff: emergency stop is set" in rows
    assert "land yes -" in rows
    assert "limits: speed 5 m/s" in rows
    assert "missions: fleet mission run FILE --robot kestrel" in rows
    assert fleet("describe", "kestrel", "--json").json["commands"][0]["refusal"] == "emergency stop is set"


@pytest.mark.usefixtures("kestrel")
def test_one_command_is_shown_with_types_units_and_ranges(fleet):
    result = fleet("describe", "kestrel", "takeoff")
    assert "fleet send kestrel takeoff altitude=NUMBER" in result.out
    assert "number  1 to 120 m" in result.out
    assert "now: no: emergency stop is set" in result.out


@pytest.mark.usefixtures("kestrel")
@pytest.mark.parametrize(("misspelt", "meant"), [("takeof", "takeoff"), ("move_foward", "move_forward")])
def test_a_misspelt_command_or_verb_is_reported_with_the_nearest(fleet, misspelt, meant):
    result = fleet("describe", "kestrel", misspelt)
    assert (result.code, f"did you mean {meant!r}?" in result.err) == (5, True)


@pytest.mark.usefixtures("kestrel")
def test_a_verb_is_not_called_unknown(fleet):
    result = fleet("describe", "kestrel", "move_forward")
    assert (result.code, "it is a verb; fleet describe kestrel shows" in result.err) == (5, True)


@pytest.mark.usefixtures("kestrel")
def test_a_robot_whose_process_is_silent_is_reported_as_such(fleet):
    result = fleet("describe", "rex")
    assert (result.code, "its worker is silent" in result.err) == (6, True)


def test_of_a_group_each_robot_has_one_line_and_one_that_is_silent_hides_no_other(fleet, play_edge):
    robots = {"kestrel": {"health": "ok"}, "rex": {"health": "ok"}, "mute": {"cause": "its worker is silent"}}
    edge = play_edge("yard-1", robots=robots, groups={"all": list(robots)})
    said = {"kestrel": FOUND, "rex": RobotDescription("rex", "toy", (CommandDescription("land"),))}

    def tell(question):
        question.reply(msgspec.json.encode(said[question.key.split("/")[3]]))
        question.close()

    for name in said:
        edge.bus.control.declare_queryable(keys.description("yard-1", name), tell)
    result = fleet("describe", "all")
    assert result.code == 7
    rows = [" ".join(row.split()) for row in result.out.splitlines()]
    assert "kestrel land; not now: takeoff" in rows
    assert "rex land" in rows
    assert any(row.startswith("mute unknown: mute does not report its commands") for row in rows)
    one = fleet("describe", "all", "takeoff")
    assert "rex there is no such command" in [" ".join(row.split()) for row in one.out.splitlines()]
    found = fleet("describe", "all", "--json").json["robots"]
    assert [each["robot"] for each in found] == ["kestrel", "rex", "mute"]
