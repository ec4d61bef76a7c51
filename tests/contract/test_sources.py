"""What linters do not check: short files, and a public surface that is small and true."""

import ast
import importlib
import re
import typing
from collections import Counter

import pytest

import fleet

# Without a type msgspec builds nothing: plain values are decoded by code that is always there.
NEEDS_THE_LOCK = {"decode", "Decoder", "convert"}


def sources(root):
    return [path for folder in ("fleet", "adapters", "plugins") for path in (root / folder).rglob("*.py")]


def nodes(path, words):
    """Return the nodes of a source in which a pattern is found: to parse them all takes long."""
    text = path.read_text()
    return ast.walk(ast.parse(text)) if re.search(words, text) else ()


def test_every_source_file_is_short(root):
    long = {str(path.relative_to(root)): len(path.read_text().splitlines()) for path in sources(root)}
    assert {name: lines for name, lines in long.items() if lines > 400} == {}


def test_all_public_names_are_loaded_from_where_they_live():
    assert sorted(fleet.__all__) == sorted([*fleet._MODULE_OF, "__version__"])
    for name, module in fleet._MODULE_OF.items():
        assert getattr(fleet, name) is getattr(importlib.import_module(module), name)


# What the packages of robots may import: the API, and the tools for simulators and tests.
PUBLIC = ("fleet.sim", "fleet.testing")


def _imports(text):
    """Yield (line, module) of each import of a source."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom):
            yield node.lineno, node.module or ""
        elif isinstance(node, ast.Import):
            yield from ((node.lineno, each.name) for each in node.names)


def _is_public(module, public=PUBLIC):
    return module == "fleet" or any(f"{module}.".startswith(f"{each}.") for each in public)


def test_adapters_and_plugins_import_only_what_is_public(root):
    """A plugin imports another package of robots by its top level alone."""
    found = set()
    for folder in ("adapters", "plugins", "examples"):
        for path in (root / folder).rglob("*.py"):
            own = path.relative_to(root / folder).parts[0]
            for line, module in _imports(path.read_text()):
                top = module.split(".")[0]
                deep = top == "fleet" and not _is_public(module)
                foreign = top.startswith("fleet_") and top not in (own, module)
                if deep or foreign:
                    found.add(f"{path.relative_to(root)}:{line} {module}")
    assert found == set()


def _shown(root):
    """Yield (place, source) of what authors copy: the Python blocks of the pages, and the scaffold."""
    for page in (root / "README.md", *(root / "docs").rglob("*.md"), *(root / "plugins").rglob("*.md")):
        text = page.read_text()
        for block in re.finditer(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
            yield f"{page.relative_to(root)}:{text[: block.start()].count(chr(10)) + 1}", block[1]
    for template in (root / "fleet" / "cli" / "scaffold").rglob("*.py.txt"):
        yield template.relative_to(root), re.sub(r"@(\w+)@", r"own_\1", template.read_text())


def test_guides_and_the_scaffold_import_only_what_is_public(root):
    shown = list(_shown(root))
    assert len(shown) > 20
    found = {
        f"{place}: {module}"
        for place, source in shown
        for _, module in _imports(source)
        if module.split(".")[0].startswith("fleet") and not _is_public(module, (*PUBLIC, "fleet.client"))
    }
    assert found == set()


def test_every_report_and_every_error_of_an_adapter_is_public():
    reports = {
        kind.__name__ for kind in typing.get_args(importlib.import_module("fleet.model.report").Report)
    }
    errors = {
        kind.__name__ for kind in fleet.CommandError.__subclasses__() + fleet.LinkError.__subclasses__()
    }
    assert reports | errors <= set(fleet.__all__)


def test_a_name_that_is_not_public_is_reported():
    with pytest.raises(AttributeError, match="module 'fleet' has no attribute 'no_such_name'"):
        _ = fleet.no_such_name


def _made_elsewhere(path):
    """Yield the lines that give msgspec a type themselves."""
    for call in nodes(path, rf"msgspec\s*\.[\w.\s]*({'|'.join(NEEDS_THE_LOCK)})"):
        if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Attribute):
            continue
        if call.func.attr not in NEEDS_THE_LOCK or not ast.unparse(call.func).startswith("msgspec."):
            continue
        typed = call.args[call.func.attr != "Decoder" :] or any(each.arg == "type" for each in call.keywords)
        if typed:
            yield call.lineno


def test_no_source_but_one_gives_msgspec_a_type_to_decode(root):
    assert len(sources(root)) > 100
    found = {
        f"{path.relative_to(root)}:{line}"
        for path in sources(root)
        if path != root / "fleet" / "runtime" / "decoding.py"
        for line in _made_elsewhere(path)
    }
    assert found == set()


def test_nobody_takes_decoders_out_of_msgspec_by_name(root):
    for path in sources(root):
        for node in nodes(path, r"from\s+msgspec"):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("msgspec"):
                assert {each.name for each in node.names}.isdisjoint(NEEDS_THE_LOCK), path


# Untyped only where the outside is: pymavlink's and MuJoCo's objects, YAML and JSON before they are checked.
MOST_ANY = 5.0  # per 1,000 lines


def test_nearly_everything_has_a_type(root):
    texts = [path.read_text() for path in sources(root)]
    untyped = sum(len(re.findall(r"^(?!from typing import).*\bAny\b", text, re.MULTILINE)) for text in texts)
    lines = sum(len(text.splitlines()) for text in texts)
    assert 1000 * untyped / lines <= MOST_ANY


def test_settings_of_the_interpreter_have_one_owner(root):
    changes = {"setswitchinterval", "freeze", "unfreeze", "set_threshold", "disable", "enable"}
    found = set()
    for path in sources(root):
        for node in nodes(path, rf"(gc|sys)\s*\.\s*({'|'.join(changes)})"):
            if isinstance(node, ast.Attribute) and node.attr in changes:
                found |= {path.name} if ast.unparse(node.value) in ("gc", "sys") else set()
    assert found == {"interpreter.py"}


MOST_METHODS = 20  # of one class, properties and private ones counted


def _methods(node):
    return sum(isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef) for each in node.body)


def test_classes_are_small(root):
    larger = {
        f"{path.relative_to(root)}:{node.name}": _methods(node)
        for path in sources(root)
        if path.read_text().count("def ") > MOST_METHODS  # few have as many: only those are parsed
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ClassDef) and _methods(node) > MOST_METHODS
    }
    assert larger == {}


VARIABLES = {"TypeVar", "ParamSpec"}  # of types: each module defines its own


def _type_names(path):
    """Return the classes and the type aliases that a module defines."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ClassDef):
            yield node.name
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name, made = node.targets[0].id, getattr(getattr(node.value, "func", None), "id", "")
            if re.fullmatch("[A-Z][a-z][A-Za-z0-9]*", name) and made not in VARIABLES:
                yield name


def _parsed_for_names(paths):
    """Return the sources that may define a name which another one defines: to parse them all takes long."""
    begins = re.compile(r"^(?:class\s+(\w+)|([A-Z][a-z][A-Za-z0-9]*)\s*=)", re.MULTILINE)
    words = {path: {"".join(found) for found in begins.findall(path.read_text())} for path in paths}
    number = Counter(word for found in words.values() for word in found)
    return [path for path, found in words.items() if any(number[word] > 1 for word in found)]


def test_a_name_stands_for_one_class_or_type_alias(root):
    modules = {}
    for path in _parsed_for_names(sources(root)):
        for name in _type_names(path):
            modules.setdefault(name, set()).add(str(path.relative_to(root)))
    assert {name: found for name, found in modules.items() if len(found) > 1} == {}
