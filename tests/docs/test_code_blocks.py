"""Each code block of the documents is checked by its language; one without a language fails."""

import ast
import contextlib
import importlib
import importlib.util
import json
import pathlib
import re
import shlex
import shutil
import tomllib

import click
import pytest
import yaml
from click.testing import CliRunner

from fleet.cli.main import fleet
from fleet.config.load import load
from fleet.config.schema import FleetConfig
from fleet.plugins.registry import Registry
from fleet_quadruped.robot.description import DogDescription

ROOT = pathlib.Path(__file__).parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")),
    *(ROOT / name for name in ("bench/README.md", "plugins/README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
FENCE = re.compile(r"^( *)```([^\n]*)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
LANGUAGES = {"python", "yaml", "yaml fragment", "sh", "json", "toml", "text", "mermaid"}
VENDORS = {"my_sdk"}
"""Modules of examples that stand for the SDK of a robot."""
OTHER_PROGRAMS = {"cd", "export", "source", "git", "uv", "pip", "mosquitto_pub", "nc"}
BASE = {
    "edge": {"id": "yard-1"},
    "robots": [
        {
            "name": name,
            "twin": f"6f0c9a1e-3a6c-4f5e-9d2e-0c5a4b3d2e1{number}",
            "adapter": "mavlink",
            "link": "sim:px4",
            "system_id": number,
        }
        for number, name in enumerate(("rex", "kestrel", "merlin", "beast"), 1)
    ],
    "groups": {"yard": ["rex"]},
}
"""What completes a block that shows only some sections of fleet.yaml."""


def blocks(*languages):
    """Return each block of these languages: page and line as its id, and its text without indentation."""
    found = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for match in FENCE.finditer(text):
            language = match[2].strip()
            if language in languages or (not languages and not language.startswith("{")):
                place = f"{page.relative_to(ROOT)}:{text[: match.start()].count(chr(10)) + 1}"
                body = re.sub(rf"^{match[1]}", "", match[3], flags=re.MULTILINE)
                found.append(pytest.param(body if languages else (page, language), id=place))
    return found


@pytest.mark.parametrize("block", blocks())
def test_a_block_names_a_language_that_is_checked(block):
    page, language = block
    made = "do not edit" in page.read_text(encoding="utf-8")[:400]
    assert language in LANGUAGES or (made and not language)


@pytest.mark.parametrize("text", blocks("python"))
def test_python_compiles_and_its_imports_exist(text):
    compile(text, "block", "exec")
    check_imports(text)


def check_imports(text):
    """Import each module that a block imports, and look up each name that it imports from one."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            for name in node.names:
                importlib.import_module(name.name)
        elif isinstance(node, ast.ImportFrom) and node.module not in VENDORS:
            module = importlib.import_module(node.module)
            for name in node.names:
                if not hasattr(module, name.name):
                    importlib.import_module(f"{node.module}.{name.name}")


@pytest.mark.parametrize(
    "line", ["import fleet.flying", "from fleet import Flying", "from fleet.clint import connect"]
)
def test_an_import_that_does_not_exist_is_found(line):
    with pytest.raises(ImportError):
        check_imports(line)


@pytest.mark.parametrize("text", blocks("json"))
def test_json_is_json(text):
    json.loads(text)


@pytest.mark.parametrize("text", blocks("toml"))
def test_toml_is_toml(text):
    tomllib.loads(text)


class Tags(yaml.SafeLoader):
    """Reads fleet.yaml's own tags as their text."""


Tags.add_multi_constructor("!", lambda loader, _suffix, node: loader.construct_scalar(node))


@pytest.mark.parametrize("text", blocks("yaml fragment"))
def test_a_fragment_of_yaml_has_known_fields(text):
    known = set(FleetConfig.model_fields) | set(DogDescription.model_fields)
    for plugin in Registry().load_all():
        known |= set(plugin.adapter.Config.model_fields)
    assert set(yaml.load(text, Tags)) <= known


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return a folder with what the examples name: certificates, a dog's description, a plugin."""
    folder = tmp_path_factory.mktemp("site")
    with contextlib.chdir(folder):
        for command in (
            "certs init my-site",
            "certs issue yard-1 --as edge --host 192.168.1.10",
            "certs issue alice --as person",
        ):
            assert CliRunner().invoke(fleet, command.split()).exit_code == 0
    (folder / "robots").mkdir()
    shutil.copy(ROOT / "adapters/fleet_quadruped/robots/example.yaml", folder / "robots/rex.yaml")
    (folder / "plugins").mkdir()
    plugin = (ROOT / "plugins/tracked_rover.py").read_text(encoding="utf-8")
    (folder / "plugins/my_robot.py").write_text(plugin.replace('"tracked-rover"', '"my-robot"'))
    return folder


@pytest.mark.parametrize("text", blocks("yaml"))
def test_yaml_is_a_fleet_file_without_an_error(text, site):
    shown = yaml.load(text, Tags)
    missing = {key: value for key, value in BASE.items() if key not in shown}
    if "robots" in shown:
        missing.pop("groups", None)
    (site / "fleet.yaml").write_text(f"{text}\n{yaml.safe_dump(missing) if missing else ''}")
    secrets = dict.fromkeys(re.findall(r"!secret (\w+)", text), "0" * 64)
    (site / "secrets.yaml").write_text(yaml.safe_dump(secrets))
    (site / "secrets.yaml").chmod(0o600)
    load(site / "fleet.yaml", environ={})  # raises with every error


def commands_in(text):
    """Return the commands of a shell block, one a line, without comments, as lists of words."""
    lines = text.replace("\\\n", " ").replace("&&", "\n").splitlines()
    return [words for line in lines if (words := shlex.split(line.rstrip("& "), comments=True))]


def check_fleet(words, context=None, command=fleet):
    """Parse a command line of fleet as click does; raises UsageError for an option that is not there."""
    context = click.Context(command, parent=context, info_name=words[0])
    _, rest, _ = command.make_parser(context).parse_args(list(words[1:]))
    if isinstance(command, click.Group) and (rest or not command.invoke_without_command):
        if "show" in command.commands and (not rest or rest[0] not in command.commands):
            rest = ["show", *rest]  # fleet adapters
        child = command.get_command(context, rest[0])
        assert child, f"no command {rest[0]!r}"
        check_fleet(rest, context, child)
    else:
        assert not rest, f"too many arguments: {rest}"


@pytest.mark.parametrize("text", blocks("sh"))
def test_the_commands_and_options_of_a_shell_block_exist(text):
    for words in commands_in(text):
        check_command(words)


def check_command(words):
    """Check one command of a shell block."""
    program, *rest = words
    program = "python" if program.endswith("/bin/python") else program
    if program == "fleet":
        check_fleet(words)
    elif program == "sudo":
        check_command(words[words.index("fleet") :])
    elif program.startswith("python") and rest[0] == "-m":
        assert rest[1] in OTHER_PROGRAMS or importlib.util.find_spec(rest[1]), rest[1]
    elif program.startswith("python"):
        script = (ROOT / rest[0]).read_text(encoding="utf-8")
        assert rest[0] != "run.py" or f'"{rest[1]}": [' in script
    else:
        assert program in OTHER_PROGRAMS or (ROOT / program).is_file(), program


@pytest.mark.parametrize(
    "line",
    [
        "fleet fly",
        "fleet ps --nonsense",
        "fleet certs make",
        "python3 run.py fly",
        "python -m nothing",
        "fly",
    ],
)
def test_a_command_that_does_not_exist_is_found(line):
    with pytest.raises((AssertionError, click.UsageError)):
        check_command(shlex.split(line))
