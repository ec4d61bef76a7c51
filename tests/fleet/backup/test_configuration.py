"""The files of a configuration; what a backup and a bundle make of them is in their own tests."""

from fleet.backup.configuration import collect
from fleet.config.load import sections_of
from fleet.config.masking import Masking
from fleet.config.yaml import read

FILE = """\
edge: {id: yard-1}
notify: [{url: "https://hooks.example.com/THE-TOKEN"}]
robots:
  - {name: rex, adapter: toy, body: rex.yaml, key: rex.key, map: /outside/map.png, other: ../other.yaml}
"""


def test_files_beside_it_are_collected_keys_are_named_and_secrets_are_masked(tmp_path):
    folder = tmp_path / "site"
    folder.mkdir()
    (tmp_path / "other.yaml").write_text("x")
    for name, text in {"fleet.yaml": FILE, "rex.yaml": "legs: 4", "rex.key": "PRIVATE KEY"}.items():
        (folder / name).write_text(text)
    file = folder / "fleet.yaml"
    found = collect(
        file, read(file, {}), sections_of(file, {}), Masking(["https://hooks.example.com/THE-TOKEN"])
    )
    assert set(found.files) == {"fleet.yaml", "rex.yaml"}
    assert b"THE-TOKEN" not in found.files["fleet.yaml"]
    assert (found.keys, found.masked) == (["rex.key"], ["fleet.yaml"])
    assert ["other.yaml" in line for line in found.left_out] == [True]


def test_of_a_file_with_the_value_of_a_secret_only_the_name_is_there(tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_text(FILE)
    (tmp_path / "rex.yaml").write_text("token: THE-VALUE")
    found = collect(file, read(file, {}), sections_of(file, {}), Masking(["THE-VALUE"]))
    assert set(found.files) == {"fleet.yaml"}
    assert found.telling == ["rex.yaml"]
