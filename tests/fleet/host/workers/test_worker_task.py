"""A worker knows its own robots alone, and imports their adapters only from files that are safe."""

import json
from importlib.metadata import EntryPoint

import msgspec
import pytest

from fleet.config.load import Loaded
from fleet.config.schema import FleetConfig
from fleet.errors import ConfigError
from fleet.host.workers.worker_task import Importer, RobotTask, read_task, robot_tasks, specs_here, task_of
from fleet.model.geodesy import GeoOrigin
from fleet.plugins.registry import Plugin, Registry
from fleet.robot_config import AdapterConfig

BUTTON = {"name": "button", "kind": "serial", "device": "/dev/serial"}
TOY = '''
"""A toy."""
import pathlib
from typing import Literal
import fleet

with open(pathlib.Path(__file__).with_name("imports"), "a") as note:
    note.write("once ")


class ToyConfig(fleet.AdapterConfig):
    adapter: Literal["toy"] = "toy"
    arms: int = 2


class Toy(fleet.Adapter[ToyConfig]):
    Config = ToyConfig
    failsafe = "it moves nothing"

    def halt(self):
        pass

    async def stop(self, reason):
        pass


class Half(Toy):
    limits = 3
'''


def robot(name, number, **fields):
    return {"name": name, "twin": f"6f0c9a1e-0000-4000-8000-00000000000{number}"} | fields


ARM, LEG = robot("arm", 1, worker="limbs"), robot("leg", 2, worker="limbs")
TOM, REX = robot("tom", 3), robot("rex", 4, worker="main")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "plugins").mkdir(mode=0o755)
    (tmp_path / "plugins" / "toy.py").write_text(TOY)
    (tmp_path / "plugins" / "toy.py").chmod(0o644)
    return tmp_path


@pytest.fixture
def loaded(folder):
    """Return the maker of a loaded file: arm and leg in a worker, tom in his own, rex in the edge."""

    def make(**sections):
        file = folder / "plugins" / "toy.py"
        drop_in, installed = Plugin("toy", str(file), file=file), Plugin("walker", "a package")
        robots = [
            (AdapterConfig(**one), installed if one is ARM else drop_in) for one in (ARM, LEG, TOM, REX)
        ]
        edge = {"edge": {"id": "yard", "spool": {"path": str(folder / "state")}}} | sections
        config = FleetConfig(**edge, robots=()).model_copy(update={"robots": tuple(one for one, _ in robots)})
        given = {one["name"]: json.dumps(one) for one in (ARM, LEG, TOM, REX)}
        return Loaded(config, Registry([]), tuple(robots), folder, given)

    return make


@pytest.mark.parametrize(
    ("worker", "names"), [("limbs", ["arm", "leg"]), ("tom", ["tom"]), ("", ["rex"]), ("none", [])]
)
def test_each_robot_is_in_the_task_of_its_own_worker(loaded, worker, names):
    assert [task.name for task in robot_tasks(loaded(), worker)] == names


def test_a_robot_has_its_drop_in_file_with_its_whole_path_or_the_name_of_an_installed_adapter(loaded, folder):
    arm, leg = robot_tasks(loaded(), "limbs")
    assert (arm.adapter, arm.file, json.loads(arm.given)) == ("walker", "", ARM)
    assert (leg.adapter, leg.file) == ("toy", str(folder / "plugins" / "toy.py"))


def test_a_task_tells_of_the_edge_what_a_worker_needs(loaded, folder):
    task = task_of(
        loaded(
            groups={"crew": ["arm", "rex"]},
            site={"origin": [48.0, 11.0, 500.0]},
            partners={"barn": {"robots": ["max", "moritz"]}},
            edge={"id": "yard", "spool": {"path": "state"}, "realtime": True},
        ),
        "limbs",
    )
    assert (task.worker, task.edge, task.folder) == ("limbs", "yard", str(folder))
    assert (task.names, task.groups) == (("arm", "leg", "tom", "rex"), {"crew": ["arm", "rex"]})
    assert (task.site, task.realtime) == (GeoOrigin(48.0, 11.0, 500.0), True)
    assert task.partners == {"max": "barn", "moritz": "barn"}
    assert task.state.startswith("/")
    assert [one.name for one in task.robots] == ["arm", "leg"]


def test_without_a_site_and_partners_a_task_has_none(loaded):
    task = task_of(loaded(), "limbs")
    assert (task.site, task.partners, task.held, task.realtime) == (None, {}, (), False)


@pytest.mark.parametrize(
    ("stopped", "held"),
    [([], ("arm", "leg")), (["arm", "rex"], ("arm",)), (["crew"], ("leg",)), (["rex"], ())],
)
def test_a_worker_knows_which_of_its_robots_a_stop_input_stops(loaded, stopped, held):
    task = task_of(loaded(groups={"crew": ["leg"]}, stop_inputs=[BUTTON | {"robots": stopped}]), "limbs")
    assert task.held == held


def test_neither_the_clouds_token_nor_other_robots_configurations_are_in_a_task(loaded):
    cloud = {"host": "broker", "token": "cw_secret"}
    task = msgspec.json.encode(task_of(loaded(cloud=cloud), "limbs"))
    assert [secret for secret in (b"cw_secret", b"broker", TOM["twin"].encode()) if secret in task] == []


def test_a_task_is_read_as_it_was_written(loaded):
    task = task_of(loaded(site={"origin": [48.0, 11.0, 500.0]}), "limbs")
    assert read_task(msgspec.json.encode(task)) == task


@pytest.mark.parametrize("payload", [b"", b"{", b"{}", b'{"worker": 1}'])
def test_a_task_that_cannot_be_read_is_refused(payload):
    with pytest.raises(ConfigError, match="the task of this worker cannot be read: "):
        read_task(payload)


def toy_task(folder, name="leg", adapter="toy", **given):
    """Return the task of a robot with the drop-in file."""
    fields = robot(name, 2, adapter="toy") | given
    return RobotTask(name, adapter, str(folder / "plugins" / "toy.py"), json.dumps(fields))


def test_a_drop_in_file_is_imported_once_for_all_its_robots(folder):
    importer = Importer(folder, Registry([]))
    leg, arm = (importer.spec(toy_task(folder, name, arms=3)) for name in ("leg", "arm"))
    assert (leg.plugin is arm.plugin, leg.config.name, arm.config.arms) == (True, "leg", 3)
    assert (leg.adapter, leg.file) == ("toy", str(folder / "plugins" / "toy.py"))
    assert (folder / "plugins" / "imports").read_text() == "once "


@pytest.mark.parametrize(("path", "mode"), [("plugins", 0o777), ("plugins/toy.py", 0o664)])
def test_a_file_that_others_may_write_is_not_imported(folder, path, mode):
    (folder / path).chmod(mode)
    with pytest.raises(ConfigError, match=r"^leg: .*toy\.py: others may write it"):
        Importer(folder, Registry([])).spec(toy_task(folder))
    assert not (folder / "plugins" / "imports").exists()


def test_an_adapter_that_a_sound_file_does_not_have_is_refused(folder):
    file = folder / "plugins" / "toy.py"
    file.write_text(TOY.partition("class Half")[0])
    with pytest.raises(ConfigError, match=r"has no adapter 'half'$"):
        Importer(folder, Registry([])).spec(toy_task(folder, adapter="half"))


def test_a_file_that_is_gone_is_refused(folder):
    (folder / "plugins" / "toy.py").unlink()
    with pytest.raises(ConfigError, match="it cannot be examined: No such file"):
        Importer(folder, Registry([])).spec(toy_task(folder))


def test_an_adapter_that_a_file_has_no_more_is_refused_with_what_is_wrong_in_the_file(folder):
    with pytest.raises(ConfigError, match=r"leg: .*toy\.py has no adapter 'half': Half: .*must be Limits"):
        Importer(folder, Registry([])).spec(toy_task(folder, adapter="half"))


def test_a_config_that_the_adapter_refuses_is_named_with_its_robot(folder):
    with pytest.raises(ConfigError, match=r"^leg: its config is refused here: [\s\S]*arms"):
        Importer(folder, Registry([])).spec(toy_task(folder, arms="many"))


def test_an_installed_adapter_is_taken_from_its_package():
    registry = Registry([EntryPoint("walker", "tests.fleet.host.field:Walker", "fleet.adapters")])
    task = RobotTask("arm", "walker", "", json.dumps(robot("arm", 1, adapter="walker", lag=0.5)))
    spec = Importer("/nowhere", registry).spec(task)
    assert (spec.plugin.__name__, spec.config.lag, spec.file) == ("Walker", 0.5, "")


@pytest.mark.parametrize(
    ("points", "why"),
    [
        ([], "it is not installed"),
        ([EntryPoint("ugv", "no_such_module:Ugv", "fleet.adapters")], "no_such_module"),
    ],
)
def test_an_installed_adapter_that_is_not_here_is_refused(points, why):
    with pytest.raises(ConfigError, match=f"^arm: the adapter 'ugv' cannot be used: .*{why}"):
        Importer("/nowhere", Registry(points)).spec(RobotTask("arm", "ugv", "", json.dumps(ARM)))


def test_the_edge_imports_the_files_of_its_own_robots_alone(loaded, folder):
    (spec,) = specs_here(loaded())
    assert (spec.config.name, type(spec.config).__name__) == ("rex", "ToyConfig")
    assert (folder / "plugins" / "imports").read_text() == "once "
