"""Two configurations of one kind stand for one machine if they say so."""

import uuid

from fleet.config.identity import identity_of
from fleet.robot_config import AdapterConfig


class Wired(AdapterConfig):
    port: str

    def identity(self):
        return self.port or None


class OtherWired(Wired):
    pass


def made(kind=Wired, **fields):
    return kind(name="rex", twin=uuid.uuid4(), **fields)


def test_two_robots_of_one_kind_on_one_port_are_one_machine():
    assert identity_of(made(port="a")) == identity_of(made(port="a"))
    assert identity_of(made(port="a")) != identity_of(made(port="b"))
    assert identity_of(made(port="a")) != identity_of(made(OtherWired, port="a"))


def test_a_robot_that_cannot_meet_itself_or_does_not_tell_has_no_identity():
    assert identity_of(made(port="")) is None
    assert identity_of(made(AdapterConfig)) is None
