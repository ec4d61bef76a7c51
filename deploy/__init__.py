"""Packages of fleet for computers that have no pip: a Debian package, and the recipe of an OCI image."""
