"""The messages of the Foxglove WebSocket protocol, byte for byte as its specification has them."""

import json

import pytest

from fleet.console.foxglove.protocol import (
    FoxgloveChannel,
    FoxgloveSubscription,
    Subscribe,
    Unsubscribe,
    advertisement,
    message_data,
    read_requested,
    server_info,
    warning,
)
from fleet.errors import WireError
from fleet.record.schemas import schema_of


def test_data_is_an_opcode_the_subscription_the_time_and_the_payload_little_endian():
    assert message_data(3, 0x0102030405060708, b"{}") == b"\x01\x03\0\0\0\x08\x07\x06\x05\x04\x03\x02\x01{}"


def test_a_server_that_is_read_only_offers_no_capability():
    message = json.loads(server_info("abc"))
    assert (message["op"], message["capabilities"], message["sessionId"]) == ("serverInfo", [], "abc")
    assert "supportedEncodings" not in message


def test_a_channel_is_offered_with_its_schema():
    message = json.loads(advertisement([FoxgloveChannel(7, "/yard-1/rex/position", "foxglove.PoseInFrame")]))
    assert message == {
        "op": "advertise",
        "channels": [
            {
                "id": 7,
                "topic": "/yard-1/rex/position",
                "encoding": "json",
                "schemaName": "foxglove.PoseInFrame",
                "schema": schema_of("foxglove.PoseInFrame").decode(),
                "schemaEncoding": "jsonschema",
            }
        ],
    }


def test_a_warning_is_a_status():
    assert json.loads(warning("slow")) == {"op": "status", "level": 1, "message": "slow"}


def test_subscriptions_are_read_also_with_members_of_later_versions():
    subscribe = '{"op": "subscribe", "subscriptions": [{"id": 0, "channelId": 3, "x": 1}], "y": 2}'
    assert read_requested(subscribe) == Subscribe((FoxgloveSubscription(0, 3),))
    assert read_requested('{"op": "unsubscribe", "subscriptionIds": [0, 1]}') == Unsubscribe((0, 1))


@pytest.mark.parametrize(
    ("message", "why"),
    [
        ('{"op": "advertise", "channels": []}', "this view is read-only: advertise is not taken"),
        ('{"op": "setParameters", "parameters": []}', "read-only: setParameters"),
        ('{"op": "getParameters", "parameterNames": []}', "read-only: getParameters"),
        ('{"op": "fetchAsset", "uri": "file:///etc/passwd", "requestId": 1}', "read-only: fetchAsset"),
        ('{"op": "subscribeConnectionGraph"}', "read-only: subscribeConnectionGraph"),
        (b"\x01\0\0\0\0{}", "it takes no data"),
        (b"\x02\0\0\0\0\0\0\0\0\0\0\0\0", "it takes no data"),
        ("garbage", "cannot be read"),
        ("[]", "cannot be read"),
        ("{}", "cannot be read"),
        ('{"op": "subscribe"}', "cannot be read"),
        ('{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 3}]}', "cannot be read"),
        ('{"op": "subscribe", "subscriptions": [{"id": 4294967296, "channelId": 3}]}', "cannot be read"),
        ('{"op": "unsubscribe", "subscriptionIds": ["0"]}', "cannot be read"),
        ("[" * 10_000, "cannot be read"),
    ],
    ids=str,
)
def test_what_is_neither_subscribe_nor_unsubscribe_is_refused(message, why):
    with pytest.raises(WireError, match=why):
        read_requested(message)
