"""Each text of each packet, broken: refused before the codec reads it, whose panic would print a page."""

import mqtt5
import pytest

from fleet.cloud.packets import PacketDecoder
from fleet.cloud.utf8 import has_broken_text
from fleet.errors import WireError

WILL = mqtt5.Will(
    topic="TEXT", payload=b"x", content_type="TEXT", response_topic="TEXT", user_properties=[("TEXT", "TEXT")]
)
TEXTS = {"user_properties": [("TEXT", "TEXT")]}
PACKETS = [
    mqtt5.ConnectPacket("TEXT", clean_start=True, username="TEXT", password=b"TEXT", will=WILL, **TEXTS),
    mqtt5.ConnAckPacket(reason_str="TEXT", assigned_client_id="TEXT", server_reference="TEXT", **TEXTS),
    mqtt5.PublishPacket("TEXT", b"\xff", content_type="TEXT", response_topic="TEXT", **TEXTS),
    mqtt5.PublishPacket("TEXT", b"\xff", qos=mqtt5.QoS(1), packet_id=1, correlation_data=b"\xff", **TEXTS),
    mqtt5.PubAckPacket(1, reason_code=mqtt5.PubAckReasonCode(0x10), reason_str="TEXT", **TEXTS),
    mqtt5.SubscribePacket(1, [mqtt5.TopicFilter("TEXT"), mqtt5.TopicFilter("TEXT")], **TEXTS),
    mqtt5.SubAckPacket(1, [mqtt5.SubAckReasonCode(0)], reason_str="TEXT", **TEXTS),
    mqtt5.UnsubscribePacket(1, ["TEXT", "TEXT"], **TEXTS),
    mqtt5.DisconnectPacket(reason_str="TEXT", server_reference="TEXT", **TEXTS),
]


def places(data):
    at = data.find(b"TEXT")
    while at >= 0:
        yield at
        at = data.find(b"TEXT", at + 1)


@pytest.mark.parametrize("packet", PACKETS, ids=lambda packet: type(packet).__name__)
def test_a_packet_whose_texts_are_right_has_none_that_is_broken(packet):
    assert not has_broken_text(memoryview(packet.write()))


@pytest.mark.parametrize("packet", PACKETS, ids=lambda packet: type(packet).__name__)
def test_a_broken_text_is_refused_wherever_it_stands_and_nothing_is_printed(packet, capfd):
    data = packet.write()
    for at in places(data):
        broken = data[:at] + b"\xff\xfe\xff\xfe" + data[at + 4 :]
        if data[at - 2 : at] == b"\x00\x04" and not is_password(packet, data, at):
            with pytest.raises(WireError, match="a text is not UTF-8"):
                list(PacketDecoder(5, 1000).feed(broken))
    assert capfd.readouterr().err == ""


def is_password(packet, data, at):
    return isinstance(packet, mqtt5.ConnectPacket) and at == max(places(data))
