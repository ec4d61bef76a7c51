import pytest

from fleet.host.safety.source_policy import SourcePolicy
from fleet.model.command import Origin, Transport
from fleet.robot_config import Accepts

ALL = ("edge", "edge_leader", "edge_follower", "tele", "sim", "sim_tele", "edit", "preview", "robot", None)


def accepted(policy: SourcePolicy, *, navigation: bool) -> set[str | None]:
    return {
        source
        for source in ALL
        if policy.refusal(Origin(Transport.CLOUD, source), navigation=navigation) is None
    }


def test_a_real_robot_obeys_tele_alone_for_commands():
    assert accepted(SourcePolicy(Accepts(), simulated=False), navigation=False) == {"tele"}


def test_a_real_robot_obeys_tele_and_edge_for_navigation():
    assert accepted(SourcePolicy(Accepts(), simulated=False), navigation=True) == {"tele", "edge"}


@pytest.mark.parametrize("navigation", [False, True])
def test_a_simulated_robot_obeys_the_simulators_sources_alone(navigation):
    assert accepted(SourcePolicy(Accepts(), simulated=True), navigation=navigation) == {"sim", "sim_tele"}


def test_the_configuration_replaces_the_set():
    policy = SourcePolicy(Accepts(command=frozenset({"edge"})), simulated=False)
    assert accepted(policy, navigation=False) == {"edge"}


def test_an_empty_list_lets_nobody_in():
    policy = SourcePolicy(Accepts(command=frozenset(), navigate=frozenset()), simulated=False)
    assert accepted(policy, navigation=False) == accepted(policy, navigation=True) == set()


def test_a_local_program_needs_no_source_type_but_a_wrong_one_is_refused():
    policy = SourcePolicy(Accepts(), simulated=False)
    assert policy.refusal(Origin(Transport.BUS)) is None
    assert policy.refusal(Origin(Transport.BUS, "sim")) is not None


def test_a_refusal_names_what_was_given_and_what_is_obeyed():
    refusal = SourcePolicy(Accepts(), simulated=False).refusal(Origin(Transport.CLOUD, "edit"))
    assert refusal == "source_type 'edit'; this robot accepts tele"


@pytest.mark.parametrize(
    ("accepts", "origin", "allowed"),
    [
        (Accepts(), Origin(Transport.BUS), True),
        (Accepts(), Origin(Transport.CLOUD), False),
        (Accepts(), Origin(Transport.CLOUD, "tele"), False),
        (Accepts(mission=frozenset({"tele"})), Origin(Transport.CLOUD, "tele"), True),
        (Accepts(mission=frozenset({"edit"})), Origin(Transport.CLOUD, "edit"), False),
        (Accepts(mission=frozenset({"edge"})), Origin(Transport.CLOUD, "edge"), False),
    ],
)
def test_a_mission_gives_nobody_rights(accepts, origin, allowed):
    policy = SourcePolicy(accepts, simulated=False)
    refusal = policy.mission_refusal(origin, commands=True, navigates=True)
    assert (refusal is None) is allowed


def test_who_may_only_lead_a_robot_may_start_what_only_leads_it():
    policy = SourcePolicy(Accepts(mission=frozenset({"edge"})), simulated=False)
    asker = Origin(Transport.CLOUD, "edge")
    assert policy.mission_refusal(asker, commands=False, navigates=True) is None
    assert policy.mission_refusal(asker, commands=True, navigates=True) is not None
