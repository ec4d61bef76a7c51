"""Which archives fleet.yaml may name as the map of the console."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pmtiles.tile import TileType

from fleet.config.basemap import HEAD, archive_problem

SITE = "site: {origin: [47.397742, 8.545594, 488.0]}\n"
FLEET = """edge: {id: yard-1}
console: {map: area.pmtiles}
robots:
  - {name: rex, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: toy, link: 'tcp:10.0.0.7:5760'}
"""


@given(st.binary(max_size=2 * HEAD))
def test_any_other_file_is_refused_by_its_first_bytes(head):
    assert archive_problem(head) == "it is no PMTiles archive"


def test_another_version_is_named():
    assert "version 2" in archive_problem(b"PMTiles\x02" + bytes(HEAD))


@pytest.mark.parametrize(
    ("kind", "problem"),
    [(TileType.MVT, "its tiles are vectors"), (TileType.UNKNOWN, "its tiles are of the unknown type 0")],
)
def test_an_archive_without_pictures_is_refused_at_its_line(yard, module_at, kind, problem):
    write_archive = module_at("tools/map_archive.py").write_archive
    write_archive(yard.folder / "area.pmtiles", {(0, 0, 0): b"a tile"}, kind=kind)
    (reported,) = yard.problems(SITE + FLEET)
    assert reported.startswith("fleet.yaml:3:")
    assert problem in reported


def test_an_archive_that_is_not_there_is_refused(yard):
    (reported,) = yard.problems(SITE + FLEET)
    assert "there is no area.pmtiles" in reported


def test_a_site_that_is_nowhere_on_earth_has_no_map(yard, module_at):
    module_at("tools/map_archive.py").write_archive(yard.folder / "area.pmtiles", {(0, 0, 0): b"a tile"})
    (reported,) = yard.problems(FLEET)
    assert "the site's position on this map is unknown" in reported
    assert "site: {origin:" in reported


def test_a_map_of_pictures_is_taken(yard, module_at):
    module_at("tools/map_archive.py").write_archive(yard.folder / "area.pmtiles", {(0, 0, 0): b"a tile"})
    assert yard.load(SITE + FLEET).config.console.map == yard.folder / "area.pmtiles"
