"""Each module with logic has its tests at the same path below tests/."""

import ast

import pytest

LOGIC = (ast.If, ast.IfExp, ast.For, ast.AsyncFor, ast.While, ast.Try, ast.Match)


def has_logic(path):
    """Return whether a module has a function that decides or repeats something."""
    functions = [
        node
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    return any(isinstance(node, LOGIC) for function in functions for node in ast.walk(function))


@pytest.mark.parametrize("tree", ["fleet", "adapters", "plugins"])
def test_every_module_with_logic_has_its_tests_at_the_same_path(root, tree):
    modules = [path for path in (root / tree).rglob("*.py") if path.name != "__init__.py"]
    assert modules
    tests = {path: root / "tests" / path.relative_to(root).with_name(f"test_{path.name}") for path in modules}
    untested = [path for path in modules if not tests[path].exists() and has_logic(path)]
    assert [path.relative_to(root).as_posix() for path in untested] == []
