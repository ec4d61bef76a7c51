"""The errors of the project: what they say to a person, and which of them belong together."""

import pytest

from fleet import errors
from fleet.errors import (
    CommandError,
    Fault,
    FleetError,
    LinkError,
    LinkLost,
    LinkRefused,
    NotReady,
    Refused,
    StateError,
    StateNewer,
    StateTaken,
    TimedOut,
    Unsupported,
    WireError,
)

ALL = [each for each in vars(errors).values() if isinstance(each, type) and issubclass(each, Exception)]


@pytest.mark.parametrize("error", ALL, ids=lambda error: error.__name__)
def test_every_error_is_one_of_the_project_and_stands_in_its_tree(error):
    assert issubclass(error, FleetError)
    assert error.__name__ in errors.__doc__


def kinds_of(error):
    """Return the errors of the module that are caught with another one; others may add their own."""
    return {each for each in error.__subclasses__() if each in ALL}


def test_an_error_is_caught_by_what_is_to_be_done_about_it():
    assert kinds_of(LinkError) == {LinkLost, LinkRefused}
    assert kinds_of(StateError) == {StateTaken, StateNewer}
    assert kinds_of(CommandError) == {NotReady, Refused, Unsupported, TimedOut, Fault}


def test_a_refused_message_names_the_place_before_the_reason():
    error = WireError("is missing", where="data.speed")
    assert (str(error), error.where) == ("data.speed: is missing", "data.speed")
    assert (str(WireError("not JSON")), WireError("not JSON").where) == ("not JSON", "")


def test_a_command_that_failed_says_why_and_what_to_do():
    error = NotReady("it is charging", hint="wait", device_result="DENIED", messages=("one", "two"))
    assert (str(error), error.reason, error.hint) == ("it is charging (wait)", "it is charging", "wait")
    assert (error.device_result, error.messages) == ("DENIED", ("one", "two"))


def test_a_command_that_failed_may_say_only_why():
    error = Fault("it fell")
    assert (str(error), error.hint, error.device_result, error.messages) == ("it fell", "", None, ())


def test_the_number_of_a_newer_format_is_kept():
    error = StateNewer("it has format 9", found=9)
    assert (str(error), error.found) == ("it has format 9", 9)
