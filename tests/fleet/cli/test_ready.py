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
def test_an_answer_that_is_no_check_list_is_told(fleet, answers, data):
    answers(data)
    result = fleet("ready", "kestrel")
    assert result.code == 5
    assert "no check list" in result.err


def test_a_robot_without_the_command_says_so(fleet, play_edge):
    edge = play_edge("yard-1", robots={"rex": {"health": "ok"}}, groups={"dogs": ["rex"]})
    edge.answers("rex", Reply("check_ready", ReplyStatus.REJECTED, "rex does not know it"))
    result = fleet("ready", "rex")
    assert (result.code, result.err) == (5, "fleet: rex: check_ready: rex does not know it\n")


def test_a_group_is_not_asked(fleet, play_edge):
    robots = {"rex": {"health": "ok"}, "rey": {"health": "ok"}}
    play_edge("yard-1", robots=robots, groups={"dogs": ["rex", "rey"]})
    result = fleet("ready", "dogs")
    assert (result.code, result.err) == (5, "fleet: dogs is a group (name one robot)\n")
