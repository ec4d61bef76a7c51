"""Kinds of drives on which a test runs that need not run on each of them, as ``any_dog`` does."""

import pytest

on_one_kind = pytest.mark.parametrize("any_dog", ["mit"], indirect=True)
"""For rules of the body, of its sensors and of its orders, which are above the drives."""
on_stiff_and_soft = pytest.mark.parametrize("any_dog", ["cia402", "moteus"], indirect=True)
"""For physics: the other kinds are as stiff as the first."""
