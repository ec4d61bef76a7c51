"""rollout.yaml: address of the store, trusted keys."""

import pytest

from fleet.config.problems import InvalidConfig
from fleet.rollout.settings import read_settings
from fleet.rollout.signature import SigningKeyError, new_key


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "site.pub").write_bytes(KEY.public.pem())
    return tmp_path


KEY = new_key()


def settings_of(folder, text):
    (folder / "rollout.yaml").write_text(text)
    return read_settings(folder / "rollout.yaml", {})


def test_paths_are_relative_to_its_folder(folder):
    settings = settings_of(
        folder, "servers: ['tls://nats.example.com:4222']\nedge: yard-1\ntrust: [site.pub]\n"
    )
    assert list(settings.trusted()) == [KEY.public.name]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "key: value"),
        ("- a", "key: value"),
        ("servers: []", "must not be empty"),
        ("servers: ['http://a']", "is no server"),
        ("servers: ['nats://nats.example.com:4222']", "is not encrypted"),
        ("servers: ['tls://a:4222']\nedge: yard-1", "an edge needs trust"),
        ("servers: ['tls://a:4222']\ntrust: [none.pub]", "there is no"),
        ("servers: ['tls://a:4222']\nuser: a", "user and password come together"),
        ("servers: ['tls://a:4222']\ncertificate: site.pub", "certificate and private_key come together"),
        ("servers: ['tls://a:4222']\nkeys: []", "keys"),
    ],
)
def test_an_unusable_value_is_reported_with_its_place(folder, text, words):
    with pytest.raises(InvalidConfig, match=words) as error:
        settings_of(folder, text)
    assert "rollout.yaml:" in str(error.value)


def test_a_file_that_is_no_public_key_is_reported(folder):
    (folder / "site.pub").write_bytes(KEY.pem())
    with pytest.raises(SigningKeyError, match=r"site\.pub: it is no public key"):
        settings_of(folder, "servers: ['tls://a:4222']\ntrust: [site.pub]").trusted()
