"""Loader of both kinds of description: a robot with joint drives of ours, or a self-walking machine."""

from __future__ import annotations

from pathlib import Path

from fleet_quadruped.robot.description import DogDescription
from fleet_quadruped.robot.reading import checked, read_tree
from fleet_quadruped.selfwalk.description import SelfWalker

AnyBody = DogDescription | SelfWalker


def load_body(path: Path) -> AnyBody:
    """Load a description of either kind; raises ConfigError with all errors."""
    tree = read_tree(path)
    by_itself = isinstance(tree, dict) and not {"frames", "objects"}.isdisjoint(tree)
    return checked(path, tree, SelfWalker) if by_itself else checked(path, tree, DogDescription)
