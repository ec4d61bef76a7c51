import pytest

from fleet.model.command import Reply, ReplyStatus

CHECKS = [
    {"check": "home", "ok": True, "words": []},
    {"check": "autopilot's own checks", "ok": False, "words": ["PreArm: GPS 1: Bad fix"]},
    {"check": "battery", "ok": None, "words": []},
]


@pytest.fixture
def answers(play_edge):
    """Let the robot kestrel give one answer to what it is asked."""

    def answers(data, command="check_ready"):
        edge = play_edge("yard-1", robots={"kestrel": {"health": "ok"}})
        taken = Reply(command, ReplyStatus.ACCEPTED)
        return edge.answers("kestrel", taken, Reply(command, ReplyStatus.ACCEPTED, done=True, data=data))

    return answers


def test_what_stands_against_a_take_off_is_shown_in_the_autopilots_words(fleet, answers):
    answers({"ready": False, "checks": CHECKS})
    result = fleet("ready", "kestrel")
    assert result.code == 5
    assert "no" in result.out.splitlines()[2]
    assert "PreArm: GPS 1: Bad fix" in result.out
    assert result.out.splitlines()[-1] == "kestrel: NOT READY"


def test_a_robot_that_is_ready_says_so(fleet, answers):
    answers({"ready": True, "checks": CHECKS[:1]})
    result = fleet("ready", "kestrel", "--json")
    assert (result.code, result.json["ready"]) == (0, True)


@pytest.mark.parametrize("data", [None, {"ready": "yes", "checks": []}, {"checks": 3}])
def test_an_answer_that_is_no_check_list_is_reported(fleet, answers, data):
    answers(data)
    result = fleet("ready", "kestrel")
    assert result.code == 5
    assert "does not answer with a check list" in result.err


def test_a_robot_without_the_command_says_so(fleet, play_edge):
    edge = play_edge("yard-1", robots={"rex": {"health": "ok"}}, groups={"dogs": ["rex"]})
    edge.answers("rex", Reply("check_ready", ReplyStatus.REJECTED, "rex does not know it"))
    result = fleet("ready", "rex")
    assert (result.code, result.err) == (5, "fleet: rex: check_ready: rex does not know it\n")


def test_of_a_group_each_robot_has_one_line_with_the_health_that_ps_shows(fleet, play_edge):
    robots = {name: {"health": "degraded" if name == "rey" else "ok"} for name in ("rex", "rey", "rue")}
    edge = play_edge("yard-1", robots=robots, groups={"birds": list(robots)})
    said = {"rex": {"ready": True, "checks": CHECKS[:1]}, "rey": {"ready": False, "checks": CHECKS}}
    for name, data in said.items():
        edge.answers(name, Reply("check_ready", ReplyStatus.ACCEPTED, done=True, data=data))
    edge.answers("rue", Reply("check_ready", ReplyStatus.REJECTED, "rue has no 'check_ready'"))
    result = fleet("ready", "birds")
    assert result.code == 7
    rows = [line.split("  ") for line in result.out.splitlines()]
    assert [part.strip() for part in rows[1] if part.strip()] == ["rex", "ok", "ready", "-"]
    assert [part.strip() for part in rows[2] if part.strip()][:3] == ["rey", "degraded", "NOT READY"]
    assert "PreArm: GPS 1: Bad fix" in result.out
    assert "rue has no 'check_ready'" in " ".join(result.out.split())
    found = {each["robot"]: each["ready"] for each in fleet("ready", "birds", "--json").json["robots"]}
    assert found == {"rex": True, "rey": False, "rue": None}
