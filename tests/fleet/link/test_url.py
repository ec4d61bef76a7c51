import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from fleet.errors import LinkRefused
from fleet.link.url import EXAMPLES, LinkText, LinkUrl, parse_link_url


def test_a_network_link_has_a_host_and_a_port():
    url = "udpout:robot.local:14550"
    assert parse_link_url(url) == LinkUrl(url, "udpout", host="robot.local", port=14550)


def test_an_ipv6_address_stands_in_brackets():
    assert parse_link_url("tcp:[fe80::1%eth0]:5760").host == "fe80::1%eth0"


def test_a_serial_link_has_a_device_and_its_speed():
    url = "serial:/dev/serial/by-id/usb-FTDI_A-if00?baud=57600"
    assert parse_link_url(url) == LinkUrl(url, "serial", path="/dev/serial/by-id/usb-FTDI_A-if00", baud=57600)


@pytest.mark.parametrize("example", EXAMPLES.values())
def test_every_example_in_an_error_is_a_good_link(example):
    assert parse_link_url(example).text == example


@pytest.mark.parametrize(
    "url",
    [
        "",
        "udp:1.2.3.4:1",
        "udpout:1.2.3.4",
        "udpout:1.2.3.4:0",
        "tcp:1.2.3.4:65536",
        "tcp:fe80::1:5760",
        "tcp://1.2.3.4:5760",
        "serial:/dev/ttyUSB0",
        "serial:ttyUSB0?baud=9600",
        "serial:/dev/ttyUSB0?baud=0",
        "serial:/dev/ttyUSB0?baud=9600&dtr=1",
        "memory:",
        "memory:a b",
    ],
)
def test_a_malformed_link_is_refused_with_an_example(url):
    with pytest.raises(LinkRefused, match=r"write it like \w+:|begin it with one of udpin:"):
        parse_link_url(url)


def test_a_simulator_that_is_not_there_is_refused_with_the_reason():
    with pytest.raises(LinkRefused, match="has no simulator"):
        parse_link_url("sim:px4")


def test_only_a_listening_link_may_take_any_free_port():
    assert parse_link_url("udpin:127.0.0.1:0").port == 0


def test_a_config_field_tells_what_is_wrong_with_a_link():
    class Config(BaseModel):
        link: LinkText

    with pytest.raises(ValidationError, match="write it like tcp:"):
        Config(link="tcp:robot")


@given(
    st.text() | st.sampled_from(list(EXAMPLES)).flatmap(lambda scheme: st.text().map(f"{scheme}:".__add__))
)
def test_any_text_is_parsed_or_refused(text):
    with contextlib.suppress(LinkRefused):
        assert parse_link_url(text).text == text
