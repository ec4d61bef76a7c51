"""Tools for authors of adapters: contract tests, a recording robot, a manual clock, faulty links.

``contract`` needs pytest; the other modules need only the dependencies of the host.
"""
