"""Who is told of faults and stops: one target each, and of which robots."""

import pytest
from pydantic import ValidationError

from fleet.config.notify import DEFAULT_EVENTS, NotifyConfig, with_members
from fleet.model.event import EventKind

HOOK = "https://hooks.example/T0/xyzzy"


@pytest.mark.parametrize(
    ("given", "what"),
    [
        ({"url": HOOK}, "webhook"),
        ({"url": "http://10.0.0.1"}, "webhook"),
        ({"command": ("mail", "-s")}, "program"),
    ],
)
def test_a_target_is_a_webhook_or_a_program(given, what):
    assert NotifyConfig(**given).what == what


@pytest.mark.parametrize("given", [{}, {"url": HOOK, "command": ("mail",)}, {"command": ()}])
def test_a_target_is_exactly_one_of_the_two(given):
    with pytest.raises(ValidationError, match="one of url and command is needed") as caught:
        NotifyConfig(**given)
    assert caught.value.errors()[0]["ctx"]["key"] == "url"


@pytest.mark.parametrize("url", ["", "hooks.example", "ftp://x", "file:///etc/passwd", " https://x"])
def test_a_webhook_is_an_address_of_http(url):
    with pytest.raises(ValidationError, match="must begin with http:// or https://"):
        NotifyConfig(url=url)


def test_the_address_is_not_printed_because_it_may_hold_a_key():
    assert "xyzzy" not in f"{NotifyConfig(url=HOOK)!r}"


def test_a_target_that_says_no_more_is_told_of_stops_and_losses_of_all_robots():
    target = NotifyConfig(url=HOOK)
    assert (target.events, target.robots) == (DEFAULT_EVENTS, ())
    assert {EventKind.STOP, EventKind.EMERGENCY_STOP, EventKind.LOST, EventKind.FAILSAFE} <= set(
        target.events
    )
    assert (target.timeout, target.per_minute) == (5.0, 12)


@pytest.mark.parametrize(
    "given",
    [
        {"timeout": 0},
        {"timeout": 61},
        {"per_minute": 0},
        {"per_minute": 601},
        {"events": ("none",)},
        {"robots": ("A",)},
        {"more": 1},
    ],
)
def test_bounds_and_words_are_checked(given):
    with pytest.raises(ValidationError) as caught:
        NotifyConfig(url=HOOK, **given)
    assert caught.value.errors()[0]["loc"][0] == next(iter(given))


@pytest.mark.parametrize("given", [{"timeout": 60}, {"timeout": 0.1}, {"per_minute": 1}, {"per_minute": 600}])
def test_the_bounds_themselves_are_taken(given):
    NotifyConfig(url=HOOK, **given)


def test_groups_stand_for_their_robots_in_the_order_that_is_given():
    given = [NotifyConfig(url=HOOK, robots=("rex", "yard", "max")), NotifyConfig(command=("mail",))]
    first, second = with_members(given, {"yard": ("a", "b"), "empty": ()})
    assert first.robots == ("rex", "a", "b", "max")
    assert first.url == given[0].url
    assert second == given[1]
