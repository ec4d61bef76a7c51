"""Reason codes of MQTT as sentences, and which of them time does not cure."""

import mqtt5
import pytest

from fleet.cloud import reasons


def test_every_code_is_one_line_that_speaks_of_the_broker():
    lines = [reasons.sentence(code) for code in range(256)]
    assert all(line.startswith(("the broker", "another client")) for line in lines)
    assert len(set(lines)) == 256
    assert "\n" not in "".join(lines)


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x84, "protocol version"),
        (0x85, "client id"),
        (0x86, "user name or password"),
        (0x87, "does not allow"),
        (0x88, "not available"),
        (0x89, "busy"),
        (0x8A, "banned"),
        (0x8B, "shutting down"),
        (0x8C, "another way to authenticate"),
        (0x8D, "received nothing from us in time"),
        (0x8E, "another client"),
        (0x93, "too many messages in flight"),
        (0x95, "too large"),
        (0x96, "too fast"),
        (0x97, "quota"),
        (0x98, "administrator"),
        (0x9C, "use another server"),
        (0x9D, "moved"),
        (0x9F, "too often"),
    ],
)
def test_a_code_means_what_the_standard_says(code, words):
    assert words in reasons.sentence(code)


def test_an_unknown_code_is_told_as_a_number():
    assert reasons.sentence(0x80) == "the broker gave the reason 0x80"
    assert reasons.sentence(0x01) == "the broker gave the reason 0x01"


@pytest.mark.parametrize("code", [0x86, 0x87])
def test_a_refused_login_says_what_to_check(code):
    assert "check cloud.token or cloud.password" in reasons.sentence(code)


@pytest.mark.parametrize(
    ("reason", "server", "more"),
    [
        (None, None, ""),
        ("", "", ""),
        ("for cleaning", None, " (for cleaning)"),
        (None, "b:1883", " (server b:1883)"),
        ("moved", "b:1883", " (moved; server b:1883)"),
    ],
)
def test_the_brokers_own_words_are_added(reason, server, more):
    assert reasons.sentence(0x9D, reason, server) == f"the broker has moved to another server{more}"


def test_a_packet_is_told_by_its_code_and_its_words():
    closed = mqtt5.DisconnectPacket(
        reason_code=mqtt5.DisconnectReasonCode.SERVER_MOVED, reason_str="x", server_reference="b"
    )
    assert reasons.of(closed) == "the broker has moved to another server (x; server b)"
    refused = mqtt5.ConnAckPacket(reason_code=mqtt5.ConnAckReasonCode.SERVER_BUSY)
    assert reasons.of(refused) == "the broker is busy"


@pytest.mark.parametrize(
    ("code", "permanent"),
    [
        *((code, True) for code in (0x84, 0x85, 0x86, 0x87, 0x8A, 0x8C, 0x8E, 0x97, 0x98, 0x9C, 0x9D, 0x9F)),
        *((code, False) for code in (0x00, 0x04, 0x80, 0x88, 0x89, 0x8B, 0x8D, 0x93, 0x95, 0x96)),
    ],
)
def test_only_what_a_second_may_cure_is_tried_again_in_haste(code, permanent):
    assert reasons.is_permanent(code) is permanent
