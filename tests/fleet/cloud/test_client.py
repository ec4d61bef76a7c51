import threading

import mqtt5
import paho.mqtt.publish
import pytest

from fleet.clock import SystemClock
from fleet.cloud.mqtt_connection import MqttConnection
from fleet.cloud.packets import PacketDecoder
from fleet.cloud.values import CloudState, Will
from fleet.errors import CloudError
from fleet.spool.spool import Spool, SpoolSettings
from fleet.wire.rules import TrafficClass
from tests.tools.waiting import wait_until

WITHIN = 60.0  # s
CONNECTED, DISCONNECTED = CloudState.CONNECTED, CloudState.DISCONNECTED
REFUSED, CLOSED = CloudState.REFUSED, CloudState.CLOSED
CONNACK = mqtt5.ConnAckPacket().write()


@pytest.fixture(params=[5, 311])
def protocol(request):
    return request.param


def test_messages_arrive_in_order_and_are_acknowledged(any_broker, watched, protocol):
    receiver = watched(any_broker.port, "receiver", {"t/+": 1}, protocol=protocol).connected()
    says = watched(any_broker.port, "says", protocol=protocol).connected()
    wanted = [b"%d" % number for number in range(2000)]
    for payload in wanted:
        assert says.publish("t/x", payload, qos=1)
    says.client.flush()
    assert receiver.payloads(2000) == wanted
    says.acked(2000)
    stats = says.client.stats
    wait_until("nothing waits or is under way", lambda: (stats.queued, stats.inflight) == (0, 0))
    assert stats.rtt > 0


@pytest.mark.parametrize("qos", [0, 1, 2])
def test_messages_of_others_arrive_once_at_every_quality(any_broker, watched, protocol, qos):
    receiver = watched(any_broker.port, "receiver", {"t": 2}, protocol=protocol).connected()
    many = [("t", f"{number}", qos, False) for number in range(50)]
    paho.mqtt.publish.multiple([*many, ("t", "end", 2, False)], "127.0.0.1", any_broker.port)
    receiver.until(lambda: receiver.messages and receiver.messages[-1].payload == b"end")
    assert [one.payload for one in receiver.messages] == [*(b"%d" % n for n in range(50)), b"end"]
    assert {one.qos for one in receiver.messages[:-1]} == {qos}


def test_an_old_message_is_marked_and_a_live_one_is_not(any_broker, watched, protocol):
    paho.mqtt.publish.single("t", "old", 1, retain=True, hostname="127.0.0.1", port=any_broker.port)
    receiver = watched(any_broker.port, "receiver", {"t": 1}, protocol=protocol).connected()
    receiver.payloads(1)
    paho.mqtt.publish.single("t", "new", 1, retain=True, hostname="127.0.0.1", port=any_broker.port)
    receiver.payloads(2)
    assert [(one.payload, one.retain) for one in receiver.messages] == [(b"old", True), (b"new", False)]


def test_what_nobody_hears_is_kept_until_somebody_does_in_its_order(any_broker, watched):
    says = watched(any_broker.port, "says").connected()
    for number in range(20):
        says.publish("t", b"%d" % number, qos=1)
    wait_until("it is held", lambda: says.client.stats.held)
    assert says.client.stats.acked == 0
    receiver = watched(any_broker.port, "receiver", {"t": 1}).connected()
    assert receiver.payloads(20) == [b"%d" % number for number in range(20)]
    says.acked(20)


def test_an_older_protocol_cannot_tell_that_nobody_hears(any_broker, watched):
    says = watched(any_broker.port, "says", protocol=311).connected()
    says.publish("nobody", qos=1)
    says.acked(1)


def test_what_we_say_does_not_come_back_to_us(any_broker, watched):
    both = watched(any_broker.port, "both", {"t": 1}).connected()
    both.publish("t", b"mine")
    both.publish("t", b"mine", qos=1, traffic=TrafficClass.REPLY)
    wait_until("the broker has it", lambda: both.client.stats.held + both.client.stats.acked)
    paho.mqtt.publish.single("t", "yours", 1, hostname="127.0.0.1", port=any_broker.port)
    assert both.payloads(1) == [b"yours"]


def test_a_message_leaves_at_once_and_one_for_later_with_what_follows(broker, watched):
    receiver = watched(broker.port, "receiver", {"t": 0}).connected()
    says = watched(broker.port, "says").connected()
    for number in range(3):
        says.publish("t", b"later", later=True)
        says.publish("t", b"now")
        assert receiver.payloads(2 * number + 2)[-2:] == [b"later", b"now"]
    assert says.client.stats.sent == 6


def test_urgent_messages_overtake_what_waits(any_broker, watched):
    receiver = watched(any_broker.port, "receiver", {"t": 1, "inbox": 1}).connected()
    says = watched(any_broker.port, "says")
    for number in range(200):
        says.publish("t", b"%d" % number, qos=1)
    says.publish("inbox", b"stop", qos=1, traffic=TrafficClass.REPLY)
    says.connected()
    assert receiver.payloads(201)[0] == b"stop"


def test_many_threads_publish_and_each_keeps_its_order(broker, watched):
    receiver = watched(broker.port, "receiver", {"t/#": 1}).connected()
    says = watched(broker.port, "says").connected()

    def talk(name):
        for number in range(300):
            says.client.publish(f"t/{name}", b"%d" % number, qos=1)

    threads = [threading.Thread(target=talk, args=(name,)) for name in "abcd"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    receiver.payloads(1200)
    for name in "abcd":
        heard = [int(one.payload) for one in receiver.messages if one.topic == f"t/{name}"]
        assert heard == list(range(300))


def test_a_fallen_connection_comes_back_with_its_subscriptions(any_broker, relay, watched, protocol):
    between = relay(any_broker.port)
    receiver = watched(between.port, "receiver", {"t": 1}, protocol=protocol).connected()
    between.cut()
    receiver.reaches(DISCONNECTED, "was lost")
    receiver.until(lambda: receiver.client.stats.connects == 2 and receiver.client.state is CONNECTED)
    paho.mqtt.publish.single("t", "again", 1, hostname="127.0.0.1", port=any_broker.port)
    receiver.payloads(1)
    assert (receiver.messages[0].payload, receiver.messages[0].qos) == (b"again", 1)


def test_what_is_published_while_a_broker_restarts_arrives_in_order(run_mosquitto, relay, watched):
    first = run_mosquitto()
    between = relay(first.port)
    says = watched(between.port, "says").connected()
    first.stop()
    says.reaches(DISCONNECTED)
    for number in range(500):
        assert says.publish("t", b"%d" % number, qos=1)
    second = first.__enter__()
    receiver = watched(second.port, "receiver", {"t": 1}).connected()
    between.target = second.port
    assert receiver.payloads(500) == [b"%d" % number for number in range(500)]


def test_what_was_not_acknowledged_is_sent_again_in_order(broker, relay, watched):
    receiver = watched(broker.port, "receiver", {"t": 1}).connected()
    between = relay(broker.port)
    says = watched(between.port, "says").connected()
    says.publish("t", b"-", qos=1)
    says.acked(1)
    broker.broker.faults.no_puback = True
    for number in range(5):
        says.publish("t", b"%d" % number, qos=1)
    receiver.payloads(6)
    broker.broker.faults.no_puback = False
    between.cut()
    says.acked(6)
    assert receiver.payloads(11)[1:] == [b"%d" % number for number in range(5)] * 2


def test_without_a_connection_qos_0_is_refused_and_counted(listener, watched):
    says = watched(listener.getsockname()[1])
    assert not says.publish("t", b"x")
    assert says.publish("t", b"x", qos=1)
    assert (says.client.stats.dropped, says.client.stats.queued) == (1, 1)


def test_a_full_queue_drops_its_oldest_and_says_so(broker, watched):
    receiver = watched(broker.port, "receiver", {"t": 1}).connected()
    spool = Spool(SpoolSettings(messages=3), SystemClock())
    says = watched(broker.port, "says", spool=spool)
    for number in range(5):
        assert says.publish("t", b"%d" % number, qos=1)
    says.connected()
    assert receiver.payloads(3) == [b"2", b"3", b"4"]
    says.acked(3)
    assert says.client.stats.dropped == 2


def test_a_message_that_ran_out_of_time_is_never_sent(broker, watched):
    receiver = watched(broker.port, "receiver", {"#": 1}).connected()
    says = watched(broker.port, "says")
    says.publish("late", qos=1, expiry=0.0)
    says.publish("timely", qos=1, expiry=60.0)
    says.connected()
    receiver.payloads(1)
    says.acked(1)
    assert says.client.stats.dropped == 1
    assert [one.topic for one in receiver.messages] == ["timely"]


def test_a_message_that_no_broker_would_take_is_an_error(broker, watched):
    client = watched(broker.port).client
    for topic, qos in (("a/+", 0), ("", 1), ("a", 3)):
        with pytest.raises(ValueError, match=r"topic|QoS"):
            client.publish(topic, b"", qos=qos)


def test_overlapping_filters_are_an_error(watched):
    with pytest.raises(ValueError, match="overlap"):
        watched(1, "edge", {"a/+": 1, "a/b": 1})


@pytest.mark.parametrize("code", [0x87, 0x89, 0x8A])
def test_a_refusal_is_reported_and_tried_again_slowly(broker, watched, code):
    broker.broker.faults.refuse = code
    edge = watched(broker.port, refused_backoff=(0.1, 0.1)).start()
    edge.reaches(REFUSED, "the broker")
    broker.broker.faults.refuse = None
    edge.reaches(CONNECTED)


def test_a_broker_that_does_not_know_us_refuses(run_mosquitto, watched, protocol):
    port = run_mosquitto("allow_anonymous false").port
    edge = watched(port, protocol=protocol, username="a", password="b").start()
    edge.reaches(REFUSED, "the broker does not a")


def test_a_broker_without_mqtt_5_is_named_as_such(listener, watched):
    edge = watched(listener.getsockname()[1]).start()
    with listener.accept()[0] as broker:
        broker.sendall(b"\x20\x02\x00\x01")
        edge.reaches(REFUSED, "protocol version")


def test_two_clients_of_one_name_do_not_fight(broker, watched):
    first = watched(broker.port, "same").connected()
    second = watched(broker.port, "same").connected()
    first.reaches(REFUSED, "client id")
    assert second.client.state is CONNECTED


def test_a_dead_link_is_noticed_and_healed(broker, watched):
    edge = watched(broker.port, keepalive=1, connect_timeout=0.5).connected()
    broker.broker.faults.freeze = True
    edge.reaches(DISCONNECTED, "silent for 1.6 s")
    broker.broker.faults.freeze = False
    edge.until(lambda: edge.client.state is CONNECTED)


def test_a_dead_link_is_noticed_though_watching_it_failed_before(broker, watched, monkeypatch, caplog):
    failed = []

    def fail(_spool):
        failed.append(1)
        raise ZeroDivisionError("oops")

    monkeypatch.setattr("fleet.spool.spool.Spool.tick", fail)
    client = watched(broker.port, keepalive=1, connect_timeout=0.5).connected()
    wait_until("watching has failed", lambda: len(failed) > 1)
    broker.broker.faults.freeze = True
    client.reaches(DISCONNECTED, "silent")
    broker.broker.faults.freeze = False
    assert "watching the cloud connection failed" in caplog.text


def test_a_codec_that_panics_is_reported_and_does_not_end_the_connecting(broker, watched, monkeypatch):
    class PanicException(BaseException):
        """As the codec raises."""

    answered = MqttConnection.wait_ready
    panics = [PanicException("oops")]

    async def panic(connection):
        if panics:
            raise panics.pop()
        await answered(connection)

    monkeypatch.setattr(MqttConnection, "wait_ready", panic)
    client = watched(broker.port).start()
    client.reaches(DISCONNECTED, "oops")
    client.reaches(CONNECTED)


def test_a_silent_connection_is_reset_so_that_nothing_of_it_arrives_late(listener, watched):
    edge = watched(listener.getsockname()[1], keepalive=1).start()
    with listener.accept()[0] as broker:
        broker.recv(4096)
        broker.sendall(CONNACK)
        edge.reaches(DISCONNECTED, "silent for 1.6 s")
        with pytest.raises(ConnectionResetError):
            list(iter(lambda: broker.recv(4096), b""))


def test_a_quiet_link_is_kept_alive(listener, watched):
    edge = watched(listener.getsockname()[1], keepalive=2).start()
    with listener.accept()[0] as broker:
        broker.recv(4096)
        broker.sendall(CONNACK)
        for _ in range(2):
            assert broker.recv(4096) == mqtt5.PingReqPacket().write()
            broker.sendall(mqtt5.PingRespPacket().write())
        assert edge.client.state is CONNECTED


def test_a_broker_that_never_answers_is_given_up(listener, watched):
    edge = watched(listener.getsockname()[1], connect_timeout=0.2).start()
    with listener.accept()[0], listener.accept()[0]:
        edge.reaches(DISCONNECTED, "did not answer within 0.2 s")


def test_nobody_at_the_port_is_reported(listener, watched):
    port = listener.getsockname()[1]
    listener.close()
    watched(port).start().reaches(DISCONNECTED, f"127.0.0.1:{port} cannot be reached")


def test_a_broker_that_talks_nonsense_gets_the_reason_and_is_left(listener, watched):
    edge = watched(listener.getsockname()[1]).start()
    with listener.accept()[0] as broker:
        broker.settimeout(20.0)
        broker.recv(4096)
        broker.sendall(CONNACK + b"\x00\x00")
        edge.reaches(DISCONNECTED, "not an MQTT packet")
        (goodbye,) = PacketDecoder(5, 100).feed(broker.recv(4096))
    assert goodbye.reason_code == mqtt5.DisconnectReasonCode.MALFORMED_PACKET


def test_the_broker_speaks_for_a_client_that_vanishes(any_broker, relay, watched, protocol):
    receiver = watched(any_broker.port, "receiver", {"gone": 1}).connected()
    between = relay(any_broker.port)
    watched(between.port, "edge", protocol=protocol, will=Will("gone", b"edge", 1)).connected()
    between.cut()
    assert receiver.payloads(1) == [b"edge"]


def test_a_client_that_closes_takes_its_will_along(any_broker, watched, protocol):
    receiver = watched(any_broker.port, "receiver", {"gone": 1, "end": 1}).connected()
    edge = watched(any_broker.port, "edge", protocol=protocol, will=Will("gone", b"edge", 1)).connected()
    edge.publish("end", b"last words", qos=1)
    edge.client.close()
    assert edge.client.stats.acked == 1
    assert receiver.payloads(1) == [b"last words"]


def test_a_closed_client_takes_nothing_and_keeps_nothing(listener, watched):
    edge = watched(listener.getsockname()[1]).start()
    edge.publish("t", qos=1)
    edge.client.close()
    assert edge.client.stats.queued == 0
    assert edge.states[-1][0] is CLOSED
    assert not edge.publish("t", qos=1)
    edge.client.close()


def test_a_client_that_was_never_started_can_be_closed(watched):
    edge = watched(1)
    edge.client.close()
    assert not edge.publish("t", qos=1)


def test_who_takes_messages_may_break_without_harm(broker, watched, caplog):
    receiver = watched(broker.port, "receiver", {"t": 1}).connected()
    says = watched(broker.port, "says").connected()
    receiver.broken = True
    for number in range(2):
        says.publish("t", b"%d" % number, qos=1, traffic=TrafficClass.REPLY)
        receiver.payloads(number + 1)
    assert "the one who takes messages is broken" in caplog.text
    assert receiver.client.stats.connects == 1


@pytest.mark.parametrize("tls", [False, True])
def test_messages_are_handed_over_in_order_while_the_loop_is_stuck(
    run_mosquitto, watched, certificate, background_loop, tls
):
    cert, key = certificate
    port = run_mosquitto(*[f"certfile {cert}", f"keyfile {key}"] * tls).port
    secure = {"host": "localhost", "tls": True, "ca_file": str(cert)} if tls else {}
    receiver = watched(port, "receiver", {"t": 1}, keepalive=5, **secure).connected()
    stuck, goes_on = threading.Event(), threading.Event()

    def block():
        stuck.set()
        assert goes_on.wait(WITHIN)

    blocked = threading.Thread(target=background_loop.call, args=(block,))
    blocked.start()
    assert stuck.wait(WITHIN)
    tls_of_paho = {"ca_certs": str(cert)} if tls else None
    for number in range(3):
        paho.mqtt.publish.single("t", f"{number}", 1, hostname="localhost", port=port, tls=tls_of_paho)
        assert receiver.payloads(number + 1)[-1] == b"%d" % number
    goes_on.set()
    blocked.join()
    receiver.publish("none")
    assert (receiver.client.state, receiver.client.stats.connects) == (CONNECTED, 1)


def test_tls_lets_in_a_broker_whose_certificate_is_trusted(run_mosquitto, watched, certificate, protocol):
    cert, key = certificate
    port = run_mosquitto(f"certfile {cert}", f"keyfile {key}").port
    secure = {"host": "localhost", "tls": True, "protocol": protocol}
    receiver = watched(port, "receiver", {"t": 1}, ca_file=str(cert), **secure).connected()
    watched(port, "says", ca_file=str(cert), **secure).connected().publish("t", b"x" * 100_000, qos=1)
    assert receiver.payloads(1) == [b"x" * 100_000]
    watched(port, "stranger", **secure).start().reaches(REFUSED, "certificate of localhost")


def test_tls_refuses_a_certificate_of_another_host(run_mosquitto, watched, certificate):
    cert, key = certificate
    port = run_mosquitto(f"certfile {cert}", f"keyfile {key}").port
    edge = watched(port, host="127.0.0.1", tls=True, ca_file=str(cert)).start()
    edge.reaches(REFUSED, "as the certificate does")


def test_a_broker_without_tls_is_distinguished(broker, watched):
    watched(broker.port, host="localhost", tls=True).start().reaches(DISCONNECTED, "wants tls: false")


def test_settings_that_are_not_safe_are_refused_before_anything_is_sent(watched, tmp_path):
    with pytest.raises(CloudError, match="clear text"):
        watched(1883, host="broker.example")
    with pytest.raises(CloudError, match="certificate file"):
        watched(8883, tls=True, ca_file=str(tmp_path / "none.pem"))
    watched(1883, host="broker.example", insecure=True)


def test_a_plain_connection_to_a_port_with_tls_says_what_to_try(run_mosquitto, watched, certificate):
    cert, key = certificate
    port = run_mosquitto(f"certfile {cert}", f"keyfile {key}").port
    watched(port).start().reaches(DISCONNECTED, "try tls: true")


@pytest.mark.parametrize("answer", [b"\x15\x03\x03\x00\x02\x02\x46", b""], ids=["an alert", "nothing"])
def test_whatever_ends_a_plain_connection_before_the_broker_says_anything_may_be_tls(
    listener, watched, answer
):
    edge = watched(listener.getsockname()[1]).start()
    theirs, _ = listener.accept()
    theirs.recv(1024)
    theirs.sendall(answer)
    theirs.close()
    edge.reaches(DISCONNECTED, "try tls: true")


def test_a_broker_that_was_heard_is_not_taken_for_one_with_tls(broker, watched, relay):
    between = relay(broker.port)
    edge = watched(between.port).connected()
    between.cut()
    edge.reaches(DISCONNECTED, "was lost")
    assert not any("tls" in cause for _, cause in edge.states)
