"""What the environment says of the cloud, where fleet.yaml leaves it out."""

import pytest

from fleet.config.environment import cloud_from_environment

ENVIRON = {
    "CYBERWAVE_MQTT_HOST": "h",
    "CYBERWAVE_MQTT_PORT": "2",
    "CYBERWAVE_MQTT_TLS_CA_CERT": "/ca.pem",
    "CYBERWAVE_MQTT_USERNAME": "007",
    "CYBERWAVE_MQTT_PASSWORD": "pass-word",
    "CYBERWAVE_API_KEY": "12345",
    "CYBERWAVE_MQTT_PROTOCOL": "311",
    "OTHER": "x",
}


@pytest.fixture
def filled(reading):
    """Read a file and complete it from an environment."""

    def filled(text, environ):
        document = reading(text)
        cloud_from_environment(document, environ)
        return document

    return filled


def test_the_environment_fills_what_the_cloud_section_leaves_out(filled):
    document = filled("cloud: {port: 1, username: anna}\n", ENVIRON)
    assert document.data["cloud"] == {
        "host": "h",
        "port": 1,
        "ca_file": "/ca.pem",
        "username": "anna",
        "password": "pass-word",
        "token": "12345",
        "protocol": "311",
    }


@pytest.mark.parametrize("text", ["cloud:\n", "cloud: {}\n", "cloud: null\n"])
def test_an_empty_cloud_section_is_a_cloud_from_the_environment(filled, text):
    assert filled(text, {"CYBERWAVE_MQTT_HOST": "h"}).data == {"cloud": {"host": "h"}}


@pytest.mark.parametrize("text", ["edge: {id: e}\n", "{}\n"])
def test_without_a_cloud_section_the_environment_makes_none(filled, text):
    assert "cloud" not in filled(text, ENVIRON).data


@pytest.mark.parametrize("text", ["cloud: no\n", "cloud: [1]\n"])
def test_a_cloud_that_is_no_mapping_is_left_for_the_schema_to_refuse(filled, text):
    before = filled(text, {}).data
    assert filled(text, ENVIRON).data == before


def test_a_field_that_is_given_as_null_counts_as_given(filled):
    assert filled("cloud: {host: null}\n", {"CYBERWAVE_MQTT_HOST": "h"}).data == {"cloud": {"host": None}}


def test_an_empty_variable_counts_as_unset(filled):
    assert filled("cloud:\n", {"CYBERWAVE_MQTT_HOST": "", "CYBERWAVE_API_KEY": ""}).data == {"cloud": {}}


@pytest.mark.parametrize(
    ("environ", "prefix"),
    [
        ({}, None),
        ({"CYBERWAVE_ENVIRONMENT": "production"}, None),
        ({"CYBERWAVE_ENVIRONMENT": " Production "}, None),
        ({"CYBERWAVE_ENVIRONMENT": "staging"}, "staging"),
        ({"CYBERWAVE_ENVIRONMENT": "staging", "CYBERWAVE_TOPIC_PREFIX": "b"}, "b"),
        ({"CYBERWAVE_TOPIC_PREFIX": "b", "CYBERWAVE_MQTT_TOPIC_PREFIX": "a"}, "a"),
        ({"CYBERWAVE_TOPIC_PREFIX": "production"}, "production"),
    ],
)
def test_the_prefix_comes_from_the_first_variable_that_is_set(filled, environ, prefix):
    assert filled("cloud: {host: h}\n", environ).data["cloud"].get("prefix") == prefix


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("1", "true"),
        ("YES", "true"),
        ("on", "true"),
        ("0", "false"),
        ("No", "false"),
        ("off", "false"),
        ("True", "true"),
        ("maybe", "maybe"),
    ],
)
def test_tls_may_be_said_in_the_words_of_environments(filled, word, meant):
    document = filled("cloud:\n", {"CYBERWAVE_MQTT_USE_TLS": word})
    assert document.data["cloud"]["tls"] == meant
    assert ("cloud", "tls") in document.texts


def test_only_tls_is_a_word_of_environments(filled):
    assert filled("cloud:\n", {"CYBERWAVE_MQTT_USERNAME": "Yes"}).data["cloud"]["username"] == "Yes"


def test_a_value_may_stand_for_a_number_and_is_named_by_its_variable_at_the_section(filled):
    document = filled("edge: 1\ncloud: {host: x}\n", {"CYBERWAVE_MQTT_PORT": "2"})
    assert ("cloud", "port") in document.texts
    mark = document.marks["cloud", "port"]
    assert (mark.line, mark.column, mark.path) == (2, 8, ("cloud", "port (from CYBERWAVE_MQTT_PORT)"))


def test_the_password_and_the_token_are_never_printed(filled):
    assert filled("cloud:\n", ENVIRON).secrets == {"pass-word", "12345"}
