"""What linters do not check: short files, and a public surface that is small and true."""

import importlib

import pytest

import fleet


def test_every_source_file_is_short(root):
    files = [path for folder in ("fleet", "adapters", "plugins") for path in (root / folder).rglob("*.py")]
    long = {str(path.relative_to(root)): len(path.read_text().splitlines()) for path in files}
    assert {name: lines for name, lines in long.items() if lines > 400} == {}


def test_all_public_names_are_loaded_from_where_they_live():
    assert sorted(fleet.__all__) == sorted([*fleet._MODULE_OF, "__version__"])
    for name, module in fleet._MODULE_OF.items():
        assert getattr(fleet, name) is getattr(importlib.import_module(module), name)


def test_the_public_surface_is_small():
    assert len(fleet.__all__) <= 40


def test_a_name_that_is_not_public_is_told():
    with pytest.raises(AttributeError, match="module 'fleet' has no attribute 'no_such_name'"):
        _ = fleet.no_such_name
