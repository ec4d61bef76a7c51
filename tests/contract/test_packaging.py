"""Each adapter in adapters/ is named everywhere pyproject.toml needs it: forgetting one is easy."""

import pytest

FORBIDDING = ("zenoh has one importer", "the MQTT codec has two importers: the cloud and the demo broker")
ADAPTERS_ONLY = "adapters use only what fleet exports"


@pytest.fixture
def packages(root):
    return {path.name for path in (root / "adapters").iterdir() if path.is_dir() and path.name[0] not in "._"}


@pytest.fixture
def contracts(project):
    return {contract["name"]: contract for contract in project["tool"]["importlinter"]["contracts"]}


def test_only_packages_called_fleet_something_are_shipped(project, packages):
    assert all(name.startswith("fleet_") for name in packages)
    shipped = project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert set(shipped) == {"fleet"} | {f"adapters/{name}" for name in packages}


def test_every_adapter_has_an_entry_point(project, packages):
    points = project["project"]["entry-points"]["fleet.adapters"].values()
    assert {point.partition(":")[0].partition(".")[0] for point in points} == packages


def test_every_adapter_is_type_checked(project, packages):
    assert set(project["tool"]["mypy"]["packages"]) == {"fleet", "bench"} | packages


def test_every_adapter_is_held_to_the_layers(project, packages, contracts):
    assert set(project["tool"]["importlinter"]["root_packages"]) == {"fleet"} | packages
    assert set(contracts[ADAPTERS_ONLY]["source_modules"]) == packages
    for name in FORBIDDING:
        assert packages <= set(contracts[name]["source_modules"]), name


def test_every_part_of_fleet_has_its_layer(root, contracts):
    layers = contracts["imports in fleet go downward only"]["layers"]
    parts = (part.strip(" ()") for layer in layers for part in layer.replace(":", "|").split("|"))
    named = {".".join(part.split(".")[:2]) for part in parts}
    free = {"fleet.__init__", "fleet.__main__", "fleet.version"}
    parts = {
        f"fleet.{path.stem}"
        for path in (root / "fleet").iterdir()
        if path.name[0] != "." and path.suffix in ("", ".py")
    }
    assert parts - free - {"fleet.__pycache__"} == named


def test_every_adapter_says_that_it_is_typed(root, packages):
    for name in packages:
        assert (root / "adapters" / name / "py.typed").is_file(), name
