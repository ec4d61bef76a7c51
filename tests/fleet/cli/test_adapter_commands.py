"""Commands that packages of adapters bring."""

from importlib.metadata import EntryPoint

import click
import pytest

from fleet.cli import adapter_commands


@click.command()
def crawl():
    """Crawl."""
    click.echo("crawling")


NOT_A_COMMAND = 5


@pytest.fixture
def brought(monkeypatch):
    """Have these entry points installed: name to value."""

    def install(**points):
        found = [EntryPoint(name, value, adapter_commands.GROUP) for name, value in points.items()]
        monkeypatch.setattr(adapter_commands.importlib.metadata, "entry_points", lambda *, group: found)
        adapter_commands.adapter_commands.cache_clear()

    yield install
    adapter_commands.adapter_commands.cache_clear()


def test_a_command_of_a_package_is_run_listed_and_suggested(fleet, brought):
    brought(crawl=f"{__name__}:crawl")
    assert fleet("crawl").out == "crawling\n"
    assert "crawl" in fleet("--help").out
    assert "did you mean 'crawl'?" in fleet("crwl").err


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("no_such_package.cli:go", "fleet crawl needs no_such_package: install its extra"),
        (f"{__name__}:no_such_name", "has no attribute 'no_such_name'"),
        (f"{__name__}:NOT_A_COMMAND", "is no click command"),
    ],
)
def test_a_command_that_cannot_be_loaded_says_why_and_hurts_no_other(fleet, brought, value, words):
    brought(crawl=value)
    result = fleet("crawl")
    assert result.code == 1
    assert words in result.err
    assert fleet("--help").code == 0


def test_a_command_of_fleet_itself_cannot_be_replaced(fleet, brought):
    brought(stop=f"{__name__}:crawl")
    assert "crawling" not in fleet("stop", "--help").out


def test_the_can_tools_come_with_the_quadrupeds():
    assert adapter_commands.adapter_commands()["can"].value == "fleet_quadruped.cli:can"
