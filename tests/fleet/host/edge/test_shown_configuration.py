"""fleet.yaml as it is shown to a person: whole, without its secrets, also when it is wrong."""

from fleet.host.edge import shown_configuration as module
from fleet.host.edge.shown_configuration import shown_configuration

FLEET = """
edge: {id: yard-1}
cloud:
  host: mqtt.example
  token: !secret cloud
robots:
  - {name: rex, adapter: toy, note: "${NOTE}", password: "open sesame"}
"""


def test_it_is_shown_as_written_without_any_secret(tmp_path):
    (tmp_path / "fleet.yaml").write_text(FLEET + "# a comment with a-long-secret in it\n")
    (tmp_path / "secrets.yaml").write_text("cloud: a-long-secret\n")
    (tmp_path / "secrets.yaml").chmod(0o600)
    text = shown_configuration(tmp_path / "fleet.yaml", {"NOTE": "hello"})
    assert "host: mqtt.example" in text
    assert "a-long-secret" not in text
    assert "open sesame" not in text


def test_a_file_that_is_wrong_is_shown_and_one_that_is_not_there_is_empty(tmp_path):
    (tmp_path / "fleet.yaml").write_text("robots: [{name: rex\n")
    assert "robots: [{name: rex" in shown_configuration(tmp_path / "fleet.yaml", {})
    assert shown_configuration(tmp_path / "none.yaml", {}) == ""


def test_a_very_long_file_is_cut_off_and_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "LONGEST", 20)
    (tmp_path / "fleet.yaml").write_text("a: 1\n" * 100)
    text = shown_configuration(tmp_path / "fleet.yaml", {})
    assert text.endswith("# the rest is left out\n")
    assert len(text) < 60
