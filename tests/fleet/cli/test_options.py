"""Options of several commands: their bounds and defaults."""

import click
import pytest
from click.testing import CliRunner

from fleet.cli.options import LONGEST, log_options, reach_option, timeout_option, wait_option


@click.command()
@reach_option
@wait_option
@timeout_option
@log_options
def command(**given):
    """Show what was given."""
    click.echo(repr(sorted(given.items())))


def run(*arguments):
    return CliRunner().invoke(command, arguments)


def given(*arguments):
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    return dict(eval(result.output))


def test_nothing_needs_to_be_said():
    assert given() == {
        "file": None,
        "wait": False,
        "timeout": 120.0,
        "log_format": "text",
        "log_file": None,
        "verbose": 0,
    }


@pytest.mark.parametrize(("text", "seconds"), [("0.001", 0.001), ("86400", LONGEST)])
def test_a_wait_is_up_to_a_day(text, seconds):
    assert given("--timeout", text)["timeout"] == seconds


@pytest.mark.parametrize("text", ["0", "-1", "86400.1", "nan", "inf"])
def test_a_wait_that_is_none_or_has_no_end_is_refused(text):
    result = run(f"--timeout={text}")
    assert result.exit_code == 2
    assert f"{float(text):g} is not within 0 and 86400 seconds" in result.output


def test_a_log_is_text_or_json_and_more_with_each_v():
    found = given("--log-format", "json", "-vv", "--log-file", "fleet.log", "-f", "fleet.yaml")
    assert (found["log_format"], found["verbose"]) == ("json", 2)
    assert (found["log_file"], found["file"]) == ("fleet.log", "fleet.yaml")
    assert run("--log-format", "xml").exit_code == 2


def test_a_log_file_is_no_folder(tmp_path):
    assert run("--log-file", str(tmp_path)).exit_code == 2
