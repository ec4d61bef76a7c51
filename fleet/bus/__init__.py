"""The local Zenoh bus; the only importer of zenoh."""
