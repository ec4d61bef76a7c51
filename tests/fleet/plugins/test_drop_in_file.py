"""A drop-in file is imported once, judged class by class, and whatever is wrong is said with its place."""

import os
import sys
from typing import Literal

import pytest

from fleet.adapter import ADAPTER_API, OLDEST_ADAPTER_API, FrameAdapter
from fleet.commands import BadDeclaration
from fleet.plugins.drop_in_file import Unusable, checked, import_file, insecure, outdated, reason_of
from fleet.robot_config import AdapterConfig

TOY = """
from typing import Literal
from fleet import AdapterConfig, FrameAdapter

class Config(AdapterConfig):
    adapter: Literal["toy"]

class Toy(FrameAdapter[Config]):
    Config = Config
    def decode(self, frame, stamp): return ()
    def halt(self): return (b"",)
"""


@pytest.fixture
def file(tmp_path):
    """Return where a drop-in file is; its module is forgotten afterwards."""
    yield tmp_path / "toy.py"
    sys.modules.pop("fleet_plugins.toy", None)


def imported(file, text):
    """Import a text; return the names of its adapters, and the reports."""
    file.write_text(text)
    found = import_file(file)
    return [name for name, _ in found.adapters], list(found.reports)


class Config(AdapterConfig):
    adapter: Literal["cart"] = "cart"


class Cart(FrameAdapter[Config]):
    """An adapter with nothing wrong."""

    Config = Config

    def decode(self, frame, stamp):
        return ()

    def halt(self):
        return (b"",)


def changed(**attributes):
    return type("Cart", (Cart,), attributes)


def refusal(adapter):
    with pytest.raises(Unusable) as error:
        checked(adapter)
    return str(error.value)


def test_an_adapter_is_known_by_the_name_in_its_config():
    assert checked(Cart) == "cart"


@pytest.mark.parametrize("thing", [7, "Cart", object, AdapterConfig, Cart.decode])
def test_what_is_no_adapter_is_refused(thing):
    assert refusal(thing) == f"{thing!r} is no subclass of Adapter or FrameAdapter"


def test_methods_that_are_missing_are_named():
    class Half(FrameAdapter[Config]):
        Config = Config

        def halt(self):
            return ()

    assert refusal(Half) == "Half does not define decode"


@pytest.mark.parametrize("config", [None, int, Config.model_fields, object()])
def test_an_adapter_needs_a_config(config):
    expected = "Cart needs a class attribute Config, a subclass of AdapterConfig"
    assert refusal(changed(Config=config)) == expected


@pytest.mark.parametrize("annotation", [str, Literal["a", "b"], Literal[7]])
def test_a_config_says_one_name(annotation):
    made = type("Odd", (AdapterConfig,), {"__annotations__": {"adapter": annotation}})
    assert refusal(changed(Config=made)) == 'Odd needs the field adapter: Literal["its name"]'
    assert refusal(changed(Config=AdapterConfig)).startswith("AdapterConfig needs the field adapter")


def test_a_field_of_the_host_keeps_its_type():
    fields = {"adapter": Literal["cart"], "name": int}
    made = type("Odd", (AdapterConfig,), {"__annotations__": fields})
    assert refusal(changed(Config=made)) == "Odd.name is a field of the host's own; give yours another name"


def test_limits_are_limits():
    assert refusal(changed(limits={"speed": 1.0})) == "Cart.limits must be Limits(...), not {'speed': 1.0}"


@pytest.mark.parametrize(
    ("api", "advice"),
    [
        (ADAPTER_API + 1, "upgrade fleet"),
        (OLDEST_ADAPTER_API - 1, "upgrade the adapter"),
        ("1", "upgrade the adapter"),
    ],
)
def test_another_version_of_the_api_is_refused_with_what_to_upgrade(api, advice):
    words = refusal(changed(api=api))
    assert words.startswith(f"Cart was written for version {api!r} of the adapter API")
    assert words.endswith(f"this fleet has version {ADAPTER_API}: {advice}")


@pytest.mark.parametrize("api", range(OLDEST_ADAPTER_API, ADAPTER_API + 1))
def test_every_supported_version_is_used_and_an_older_one_with_a_warning(api):
    adapter = changed(api=api)
    assert checked(adapter) == "cart"
    assert bool(outdated(adapter)) is (api < ADAPTER_API)


def test_a_file_gives_its_adapters(file):
    assert imported(file, TOY) == (["toy"], [])


@pytest.mark.parametrize(
    ("text", "report"),
    [
        ("", "it defines no Adapter or FrameAdapter"),
        ("from fleet import FrameAdapter", "it defines no Adapter or FrameAdapter"),
        ("x = 1\nraise ValueError('bad')", "ValueError: bad ({file}:2)"),
        ("import sys\nsys.exit(3)", "SystemExit: 3 ({file}:2)"),
        ("x = (", "'(' was never closed ({file}:1)"),
        ("def f():\n    1 // 0\nf()", "ZeroDivisionError: integer division or modulo by zero ({file}:2)"),
        ("raise ValueError('two\\nlines')", "ValueError: two lines ({file}:1)"),
    ],
)
def test_a_file_that_cannot_be_used_is_one_report_with_its_place(file, text, report):
    assert imported(file, text) == ([], [report.format(file=file)])
    assert "fleet_plugins.toy" not in sys.modules or "defines no" in report


@pytest.mark.parametrize(
    ("text", "report"),
    [
        ("import no_such", "No module named 'no_such' ({file}:1)"),
        ("\ndef broken(:\n", "invalid syntax ({file}:2)"),
        ("a = 'x\x00'", "source code string cannot contain null bytes"),
        ("class Panic(BaseException): pass\nraise Panic('gone')", "Panic: gone ({file}:2)"),
        (
            "from fleet import FrameAdapter\nclass Bare(FrameAdapter): pass",
            "Bare: Bare does not define decode, halt",
        ),
        (TOY.replace("    Config = Config\n", ""), "needs a class attribute Config"),
        (TOY.replace('Literal["toy"]', "str"), 'Config needs the field adapter: Literal["its name"]'),
        (
            TOY + "    @command('go')\n    async def go(self, far): ...\n",
            "command method go: far has no type; write it like far: Annotated",
        ),
        (
            TOY + "    api = 2\n",
            "version 2 of the adapter API, this fleet has version 1: upgrade fleet",
        ),
        (TOY + "    api = 0\n", "this fleet has version 1: upgrade the adapter"),
        (TOY + "    limits = 5\n", "Toy.limits must be Limits(...), not 5"),
        (
            TOY.replace("class Toy(", "    limits: float = 1.0\n\nclass Toy("),
            "Config.limits is a field of the host's own; give yours another name",
        ),
    ],
    ids=range(12),
)
def test_a_file_without_a_usable_class_is_one_report(file, text, report):
    names, (said,) = imported(file, text.replace("from fleet import", "from fleet import command,", 1))
    assert names == []
    assert report.format(file=file) in said


def test_one_class_that_is_wrong_costs_no_other(file):
    odd = "class Odd(FrameAdapter):\n    def halt(self): return ()\n    def decode(self, *_): return ()\n"
    more = f"{TOY}\n{odd}"
    names, reports = imported(file, more)
    assert names == ["toy"]
    (report,) = reports
    assert report.startswith("Odd: Odd needs ")


def test_private_and_abstract_classes_are_no_adapters_where_others_are(file):
    more = TOY + "\nclass _Base(Toy): pass\nclass Half(FrameAdapter): pass\n"
    assert imported(file, more) == (["toy"], [])


def test_only_an_interrupt_of_a_person_ends_an_import(file):
    file.write_text("raise KeyboardInterrupt")
    with pytest.raises(KeyboardInterrupt):
        import_file(file)
    assert "fleet_plugins.toy" not in sys.modules


def test_what_a_file_prints_is_not_taken_for_an_answer(file, capsys):
    imported(file, "print('hello')" + TOY)
    assert capsys.readouterr() == ("", "hello\n")


def test_a_file_that_is_no_python_is_refused(tmp_path):
    (tmp_path / "toy.txt").write_text(TOY)
    assert import_file(tmp_path / "toy.txt").reports == ("it is not a Python file",)


@pytest.mark.parametrize("error", [Unusable("it lacks wheels"), BadDeclaration("dock has no types")])
def test_what_is_said_of_a_class_needs_no_place(error, file):
    assert reason_of(error, file) == str(error)


def test_a_file_that_is_gone_is_not_trusted(tmp_path):
    assert insecure(tmp_path / "gone.py") == "it cannot be examined: No such file or directory"


def test_code_of_another_user_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 4711)
    file = tmp_path / "toy.py"
    file.write_text(TOY)
    if file.stat().st_uid == 0:
        assert insecure(file) == "", "root may do all anyway"
        os.chown(file, 1234, -1)
    assert "it belongs to another user (uid" in insecure(file)


def test_a_file_that_changed_within_the_same_second_is_imported_as_it_is_now(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.dont_write_bytecode", False)
    file, saved = tmp_path / "toy.py", 1_800_000_000
    for name in ("toy", "boy"):
        file.write_text(TOY.replace('"toy"', f'"{name}"'))
        os.utime(file, (saved, saved))
        assert [found for found, _ in import_file(file).adapters] == [name]
