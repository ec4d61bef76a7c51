"""How Sphinx builds the site from these pages: ``python3 run.py docs``."""  # noqa: INP001 - a script

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pydantic

import fleet

if TYPE_CHECKING:
    from sphinx.application import Sphinx

for _name in fleet.__all__:  # loaded on first use; autodoc lists what is loaded
    getattr(fleet, _name)

project = "fleet"
project_copyright = "the authors of fleet, Apache License 2.0"
version = release = fleet.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc"]
exclude_patterns = ["_build"]
myst_heading_anchors = 4  # pages link to headings of other pages as GitHub does
suppress_warnings = ["myst.header"]  # a generated page may begin a section below the level of the last one

html_theme = "furo"
html_title = f"fleet {release}"
html_copy_source = False

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_default_options = {"exclude-members": "model_config, Config"}


def setup(app: Sphinx) -> None:
    """Show a model of fleet.yaml without its fields: they have a reference of their own (config.md)."""
    app.connect("autodoc-process-signature", _short_signature)


def _short_signature(
    _app: Sphinx,
    _what: str,
    _name: str,
    thing: Any,
    _options: Any,
    signature: str | None,
    returns: str | None,
) -> tuple[str | None, str | None]:
    """Return the signature to print: ``(**fields)`` for a pydantic model."""
    if isinstance(thing, type) and issubclass(thing, pydantic.BaseModel):
        return "(**fields)", None
    return signature, returns
