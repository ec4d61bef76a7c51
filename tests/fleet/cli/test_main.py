import importlib
import subprocess
import sys

import click
import pytest

from fleet.cli.main import COMMANDS, main
from fleet.version import __version__

SHOW_MODULES = """
import sys
sys.argv = ["fleet", {argument!r}]
from fleet.__main__ import main
code = main()
heavy = {{"click", "msgspec", "pydantic", "rich", "yaml", "zenoh"}}
sys.stderr.write(" ".join(sorted(heavy & set(sys.modules))))
sys.exit(code)
"""


def run_alone(argument):
    """Run the program in a fresh interpreter; its stderr names the heavy modules it loaded."""
    script = SHOW_MODULES.format(argument=argument)
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)


def test_the_version_is_reported_without_loading_anything():
    done = run_alone("--version")
    assert (done.stdout, done.stderr) == (f"fleet {__version__}\n", "")


def test_help_loads_no_command():
    assert run_alone("--help").stderr == "click"


def command_of(name):
    """Import a command."""
    module, _, attribute = COMMANDS[name].place.partition(":")
    return getattr(importlib.import_module(module), attribute)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_of_the_table_is_there_and_explains_itself(name):
    command = command_of(name)
    assert isinstance(command, click.Command)
    assert command.help


@pytest.mark.parametrize("name", COMMANDS)
def test_the_line_of_the_overview_says_what_the_command_does(name):
    help_text = command_of(name).help
    assert COMMANDS[name].summary.split()[0] == help_text.split()[0]
    assert COMMANDS[name].summary.endswith(".")


def speaks_json(command):
    return "--json" in [option for each in command.params for option in each.opts]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_can_speak_json(name):
    command = command_of(name)
    parts = getattr(command, "commands", {}).values()
    assert speaks_json(command) or (parts and all(map(speaks_json, parts)))


def test_help_lists_every_command(fleet):
    result = fleet("--help")
    assert result.code == 0
    assert all(each.summary in " ".join(result.out.split()) for each in COMMANDS.values())


@pytest.mark.parametrize(("wrong", "near"), [("chek", "check"), ("adaptors", "adapters"), ("stpo", "stop")])
def test_a_misspelt_command_is_reported_with_the_nearest(fleet, wrong, near):
    result = fleet(wrong)
    assert (result.code, result.out) == (2, "")
    assert f"there is no command {wrong!r}; did you mean {near!r}?" in result.err


def test_a_wrong_option_is_a_usage_error(fleet):
    assert fleet("check", "--jsno").code == 2


def test_a_config_error_ends_any_command_with_its_code(fleet, place):
    (place / "fleet.yaml").write_text("edge: [\n")
    result = fleet("adapters")
    assert (result.code, result.out) == (3, "")
    assert "fleet.yaml:2:1: did not find expected node content" in result.err


def test_an_interrupt_has_its_own_code(fleet, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("fleet.cli.check.load", interrupted)
    assert fleet("check").code == 130


def test_a_reader_that_went_away_is_no_traceback(place):
    process = subprocess.Popen(
        [sys.executable, "-m", "fleet", "schema"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=place
    )
    process.stdout.close()
    assert process.wait(60) == 1
    assert process.stderr.read() == b""
    process.stderr.close()


def test_a_full_disk_behind_the_output_is_reported_in_one_line(place):
    with open("/dev/full", "w") as full:  # noqa: PTH123 - a device
        command = [sys.executable, "-m", "fleet", "schema"]
        done = subprocess.run(command, check=False, stdout=full, stderr=subprocess.PIPE, cwd=place)
    assert (done.returncode, done.stderr) == (1, b"fleet: [Errno 28] No space left on device\n")


def test_a_command_runs_without_an_output(monkeypatch, play_edge):
    edge = play_edge("yard-1", robots={"rex": {}})
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    assert main(["stop", "rex"]) == 0
    sys.stdout.close()
    sys.stderr.close()
    assert edge.stops == [["rex"]]


def test_who_closes_all_that_is_open_gets_none_of_it_for_our_links():
    script = "import os, sys; from fleet.__main__ import main; sys.argv[1:] = ['--help']; main(); "
    script += "sys.exit([os.readlink(f'/proc/self/fd/{fd}') for fd in range(3)] != ['/dev/null'] * 3)"
    shell = ["sh", "-c", 'exec "$0" -c "$1" <&- >&- 2>&-', sys.executable, script]
    assert subprocess.run(shell, check=False, timeout=60).returncode == 0


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["ps", "--json"], 4, "no edge is running here"),
        (["send", "rex", "beep", "--json"], 4, "no edge is running here"),
        (["check", "--json", "--nonsense"], 2, "No such option"),
        (["adapters", "--json"], 3, "did not find expected node content"),
        (["params", "rex", "diff", "none.param", "--json"], 3, "none.param"),
    ],
)
@pytest.mark.usefixtures("runtime")
def test_with_json_whatever_fails_is_json_on_stdout_and_words_on_stderr(fleet, place, arguments, code, said):
    if "adapters" in arguments:
        (place / "fleet.yaml").write_text("edge: [\n")
    result = fleet(*arguments)
    assert (result.code, result.json["code"]) == (code, code)
    assert said in result.json["error"]
    assert said in result.err
