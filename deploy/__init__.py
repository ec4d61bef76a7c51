"""Packaging of fleet for computers without pip: a Debian package, and files for an OCI image."""
