"""Content of a bundle that is built from a configuration, and what it must not contain."""

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from fleet.rollout.bundle import BundleError
from fleet.rollout.making import make

FILE = """\
edge: {id: yard-1}
plugins: [plugins]
cloud: {host: mqtt.example.com, token: !secret cyberwave_token}
robots: !include robots.yaml
"""
ROBOTS = """\
- name: rex
  twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
  adapter: toy
  body: bodies/rex.yaml
"""


@pytest.fixture
def site(tmp_path):
    for name, text in {
        "fleet.yaml": FILE,
        "robots.yaml": ROBOTS,
        "secrets.yaml": "cyberwave_token: THE-VALUE\n",
        "plugins/toy.py": "import fleet\n",
        "bodies/rex.yaml": "legs: 4\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "secrets.yaml").chmod(0o600)
    return tmp_path


def made(site, *edges, file="fleet.yaml"):
    return make(site / file, edges, 3, {}, 1e9).bundle


def test_it_contains_all_files_of_the_fleet_file_and_only_names_of_secrets(site):
    bundle = made(site)
    assert set(bundle.files) == {"fleet.yaml", "robots.yaml", "plugins/toy.py", "bodies/rex.yaml"}
    assert (bundle.edges, bundle.secrets, bundle.version) == (("yard-1",), ("cyberwave_token",), 3)
    assert not any(b"THE-VALUE" in content for content in bundle.files.values())
    assert bundle.files["fleet.yaml"].decode() == FILE


def test_it_contains_empty_files_too(site):
    (site / "plugins" / "__init__.py").write_text("")
    (site / "bodies" / "rex.yaml").write_text("")
    found = make(site / "fleet.yaml", (), 3, {}, 1e9)
    assert (found.bundle.files["plugins/__init__.py"], found.bundle.files["bodies/rex.yaml"]) == (b"", b"")
    assert found.left_out == ()


def test_it_may_be_for_other_edges_and_from_a_file_with_another_name(site):
    (site / "fleet.yaml").rename(site / "yard.yaml")
    bundle = made(site, "yard-1", "yard-2", file="yard.yaml")
    assert bundle.edges == ("yard-1", "yard-2")
    assert "fleet.yaml" in bundle.files
    assert "yard.yaml" not in bundle.files


@pytest.mark.parametrize("line", ["password: plain-text", "token: cw_0123456789"])
def test_a_literal_secret_in_the_file_is_refused_with_its_line(site, line):
    cloud = f"cloud: {{host: mqtt.example.com, username: a, {line}}}"
    (site / "fleet.yaml").write_text(FILE.replace(FILE.splitlines()[2], cloud))
    with pytest.raises(BundleError, match=r"fleet\.yaml:3: a secret stands here; write  !secret NAME"):
        made(site)


def test_a_private_key_beside_the_file_is_refused(site):
    (site / "bodies" / "rex.yaml").write_text("-----BEGIN PRIVATE KEY-----\n")
    with pytest.raises(BundleError, match="is a private key, which stays on its edge"):
        made(site)


@pytest.mark.parametrize("name", ["plugins/toy.py", "plugins/_hidden.py", "bodies/rex.yaml"])
def test_a_secret_in_any_other_file_is_refused(site, name):
    (site / name).write_text('TOKEN = "THE-VALUE"\n')
    with pytest.raises(BundleError, match=f"{name} has the value of a secret in it"):
        made(site)


@pytest.mark.parametrize("password", [None, b"of-the-key"])
def test_a_private_key_in_der_form_is_refused(site, password):
    kind = serialization.BestAvailableEncryption(password) if password else serialization.NoEncryption()
    form = serialization.PrivateFormat.PKCS8
    key = Ed25519PrivateKey.generate().private_bytes(serialization.Encoding.DER, form, kind)
    (site / "bodies" / "rex.yaml").write_bytes(key)
    with pytest.raises(BundleError, match="is a private key, which stays on its edge"):
        made(site)


def test_a_file_that_is_named_as_a_key_is_refused_whatever_its_content(site):
    tls = '{listen: "127.0.0.1:8443", tls: {cert: web.pem, key: web.bin}}'
    (site / "fleet.yaml").write_text(f"{FILE}console: {tls}\n")
    (site / "web.pem").write_text("certificate")
    (site / "web.bin").write_bytes(b"\x01\x02")
    with pytest.raises(BundleError, match=r"web\.bin is a private key"):
        made(site)


def test_it_does_not_contain_the_people_of_the_console(site):
    (site / "fleet.yaml").write_text(f"{FILE}console: {{people: people.json}}\n")
    (site / "people.json").write_text("[]")
    found = make(site / "fleet.yaml", (), 3, {}, 1e9)
    assert "people.json" not in found.bundle.files
    assert ["people.json: it says who may log in" in line for line in found.left_out] == [True]
