import textwrap
from importlib.metadata import EntryPoint, distributions

import pytest

from fleet.plugins.registry import GROUP, PluginState, Registry

BODY = """
from typing import Literal
from fleet import AdapterConfig, FrameAdapter

class Config(AdapterConfig):
    adapter: Literal["{name}"]
    link: str

class {name}Adapter(FrameAdapter[Config]):
    Config = Config
    def decode(self, frame, stamp): return ()
    def halt(self): return (b"",)
"""


@pytest.fixture
def folder(tmp_path):
    """Write files into a drop-in folder and return the registry that has loaded it."""

    def folder(**files):
        for stem, text in files.items():
            (tmp_path / f"{stem}.py").write_text(textwrap.dedent(text))
        registry = Registry([])
        registry.add_folder(tmp_path)
        return registry

    return folder


def body(name):
    return BODY.format(name=name)


def point(value, name="toy"):
    return EntryPoint(name=name, value=value, group=GROUP)


def test_a_drop_in_file_gives_an_adapter_under_its_configs_name(folder):
    plugin = folder(anything=body("blinky")).get("blinky")
    assert plugin.state is PluginState.LOADED
    assert plugin.adapter is None, "it is not imported here"
    assert plugin.description.cls == "fleet_plugins.anything:blinkyAdapter"


def test_only_what_a_file_defines_itself_counts(folder):
    text = body("blinky") + "from fleet.adapter import Adapter\nAlias = blinkyAdapter\n"
    assert folder(a=text).names() == ("blinky",)


def test_files_that_begin_with_an_underscore_are_not_loaded(folder):
    assert folder(_draft="raise SystemExit").plugins() == ()


@pytest.mark.parametrize(
    ("text", "report"),
    [
        ("import no_such", "No module named 'no_such' ({file}:1)"),
        (body("x") + "    limits = 5\n", "xAdapter.limits must be Limits(...), not 5"),
    ],
    ids=["the file", "a class"],
)
def test_a_file_that_cannot_be_used_is_a_report_with_the_place(folder, tmp_path, text, report):
    (plugin,) = folder(broken=text).plugins()
    assert (plugin.name, plugin.state, plugin.adapter) == ("broken", PluginState.FAILED, None)
    assert report.format(file=tmp_path / "broken.py") in plugin.report


OUTDATED = (
    "was written for version 1 of the adapter API, this fleet has version 2, and the next minor release"
)


def test_a_file_for_the_version_before_of_the_api_is_used_with_a_warning(folder):
    raised = "import fleet.plugins.drop_in_file as loader\nloader.ADAPTER_API = 2\n"
    plugin = folder(old=raised + body("old")).get("old")
    assert plugin.state is PluginState.LOADED
    assert f"oldAdapter {OUTDATED}" in plugin.report
    assert plugin.report.endswith("change it for version 2 and set api = 2 in its class")
    new = folder(new=raised + body("new") + "    api = 2\n").get("new")
    assert (new.state, new.report) == (PluginState.LOADED, "")


def test_a_broken_file_costs_only_itself(folder):
    registry = folder(a_broken="1/0", blinky=body("blinky"))
    assert registry.get("blinky").state is PluginState.LOADED
    assert registry.get("a_broken").state is PluginState.FAILED


def test_two_plugins_of_one_name_are_both_refused_naming_both(folder, tmp_path):
    plugin = folder(one=body("blinky"), two=body("blinky")).get("blinky")
    assert plugin.state is PluginState.FAILED
    assert f"{tmp_path / 'one.py'} and {tmp_path / 'two.py'}" in plugin.report


def test_two_files_of_one_name_are_reported(folder, tmp_path):
    registry = folder(blinky=body("blinky"))
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "blinky.py").write_text(body("other"))
    registry.add_folder(tmp_path / "more")
    assert "another drop-in file is called blinky.py" in registry.plugins()[1].report


def test_a_folder_that_is_named_twice_counts_once(folder, tmp_path):
    registry = folder(blinky=body("blinky"))
    registry.add_folder(tmp_path)
    assert [plugin.state for plugin in registry.plugins()] == [PluginState.LOADED]


def test_what_a_plugin_prints_is_not_taken_for_an_answer(folder, capfd):
    loud = "import os, sys\nprint('hello')\nsys.stderr.write('hello')\nos.write(1, b'hello')\n"
    assert folder(loud=loud + body("loud")).get("loud").state is PluginState.LOADED
    assert capfd.readouterr() == ("", "")


def test_an_unknown_name_is_none():
    assert Registry([]).get("nothing") is None


class TestEntryPoints:
    @pytest.fixture
    def module(self, tmp_path, monkeypatch):
        """Write an importable module of this name."""
        monkeypatch.syspath_prepend(tmp_path)

        def module(name, text):
            (tmp_path / f"{name}.py").write_text(textwrap.dedent(text))

        return module

    def test_one_is_listed_without_being_imported(self):
        (plugin,) = Registry([point("no_such_module:Toy")]).plugins()
        assert (plugin.name, plugin.state) == ("toy", PluginState.DECLARED)

    def test_one_is_imported_when_it_is_asked_for(self, module):
        module("registry_toy_a", body("toy"))
        plugin = Registry([point("registry_toy_a:toyAdapter")]).get("toy")
        assert plugin.state is PluginState.LOADED
        assert plugin.adapter.__name__ == "toyAdapter"

    def test_one_for_the_version_before_of_the_api_is_used_with_a_warning(self, module, monkeypatch):
        monkeypatch.setattr("fleet.plugins.drop_in_file.ADAPTER_API", 2)
        module("registry_toy_e", body("toy"))
        plugin = Registry([point("registry_toy_e:toyAdapter")]).get("toy")
        assert plugin.state is PluginState.LOADED
        assert f"toyAdapter {OUTDATED}" in plugin.report

    def test_one_for_a_version_that_is_no_longer_accepted_is_refused(self, module, monkeypatch):
        monkeypatch.setattr("fleet.plugins.drop_in_file.ADAPTER_API", 3)
        monkeypatch.setattr("fleet.plugins.drop_in_file.OLDEST_ADAPTER_API", 2)
        module("registry_toy_f", body("toy"))
        plugin = Registry([point("registry_toy_f:toyAdapter")]).get("toy")
        assert plugin.state is PluginState.FAILED
        assert "version 1 of the adapter API, this fleet has version 3: upgrade the adapter" in plugin.report

    @pytest.mark.parametrize(
        ("value", "report"),
        [
            ("no_such_module:Toy", "No module named 'no_such_module'"),
            ("registry_toy_b:Nothing", "AttributeError"),
            ("registry_toy_b:Config", "is no subclass of Adapter or FrameAdapter"),
            ("registry_toy_b:FrameAdapter", "FrameAdapter does not define decode, halt"),
            (
                "registry_toy_b:tallAdapter",
                "its Config says adapter: 'tall' but its entry point is called 'toy'",
            ),
        ],
    )
    def test_one_that_cannot_be_used_is_a_report(self, module, value, report):
        module("registry_toy_b", body("tall"))
        plugin = Registry([point(value)]).get("toy")
        assert plugin.state is PluginState.FAILED
        assert report in plugin.report

    def test_one_that_exits_is_a_report(self, module):
        module("registry_toy_c", "raise SystemExit('no licence')")
        assert "SystemExit: no licence" in Registry([point("registry_toy_c:Toy")]).get("toy").report

    def test_one_that_is_listed_twice_alike_counts_once(self):
        (plugin,) = Registry([point("a:B"), point("a:B")]).plugins()
        assert plugin.state is PluginState.DECLARED

    def test_two_of_one_name_are_refused(self):
        (plugin,) = Registry([point("a:B"), point("c:D")]).plugins()
        assert "two plugins are called 'toy': a:B and c:D" in plugin.report

    def test_a_missing_library_is_reported_with_the_extra_that_brings_it(self, tmp_path, monkeypatch):
        monkeypatch.syspath_prepend(tmp_path)
        (tmp_path / "registry_toy_d.py").write_text("import py_toy_lib")
        info = tmp_path / "zenoh_fleet-9.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(
            "Metadata-Version: 2.1\nName: zenoh-fleet\nVersion: 9\nProvides-Extra: toys\n"
            "Requires-Dist: py-toy-lib>=1; extra == 'toys'\n"
        )
        (info / "entry_points.txt").write_text(f"[{GROUP}]\ntoy = registry_toy_d:Toy\n")
        (found,) = own_points(tmp_path)
        report = Registry([found]).get("toy").report
        assert report.endswith("install it: uv sync --extra toys, or pip install 'zenoh-fleet[toys]'")


def own_points(folder):
    """Return the entry points of the packages in this folder alone."""
    found = [point for dist in distributions(path=[str(folder)]) for point in dist.entry_points]
    return [point for point in found if point.group == GROUP]
