"""No module imports itself through others, not even by an import inside a function."""

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter

CURE = "move what both need below both"


def module_names(root):
    """Return the path of each module of fleet/ and adapters/ by its name."""
    paths = {}
    for base, folder in ((root, root / "fleet"), (root / "adapters", root / "adapters")):
        for path in folder.rglob("*.py"):
            parts = path.relative_to(base).with_suffix("").parts
            paths[".".join(parts[: len(parts) - (parts[-1] == "__init__")])] = path
    return paths


def imports_at_run_time(node: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Yield the imports below a node that are not for type checkers alone; no expression has any."""
    if isinstance(node, ast.Import | ast.ImportFrom):
        yield node
        return
    typing_only = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
    for child in node.orelse if typing_only else ast.iter_child_nodes(node):
        if not isinstance(child, ast.expr):
            yield from imports_at_run_time(child)


def imported(source, known):
    """Return the known modules that a source imports at run time."""
    found = set()
    for node in imports_at_run_time(ast.parse(source)):
        for each in node.names:
            if isinstance(node, ast.Import):
                found.add(each.name)
            else:
                inner = f"{node.module}.{each.name}"
                found.add(inner if inner in known else node.module)
    return found & known.keys()


def cycle_in(sources):
    """Return a cycle of imports as text, empty if there is none; ``sources``: text by module name."""
    graph = {name: imported(text, sources) - {name} for name, text in sources.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return " <- ".join(error.args[1])
    return ""


def test_there_is_no_import_cycle(root):
    sources = {name: path.read_text() for name, path in module_names(root).items()}
    assert len(sources) > 500
    cycle = cycle_in(sources)
    assert not cycle, f"import cycle: {cycle}; {CURE}"


def test_a_cycle_through_a_function_is_found_and_one_of_types_alone_is_not():
    lower = "if TYPE_CHECKING:\n    from a.upper import Kind\n"
    assert cycle_in({"a.upper": "from a import lower", "a.lower": lower}) == ""
    hidden = "def build():\n    from a.upper import Kind\n"
    found = cycle_in({"a.upper": "from a import lower", "a.lower": hidden})
    assert sorted(set(found.split(" <- "))) == ["a.lower", "a.upper"]
