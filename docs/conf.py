"""How the pages become a site: ``sphinx-build -W -q docs site``."""

import re
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

_PACKAGE = Path(__file__).parents[1] / "vibro_cli" / "__init__.py"

project = "vibro"
author = "The vibro developers"
release = re.findall(r'^__version__ = "(.*)"$', _PACKAGE.read_text("utf-8"), re.MULTILINE)[0]

extensions = ["myst_nb"]
exclude_patterns = ["jupyter_execute"]
myst_enable_extensions = ["deflist"]
myst_heading_anchors = 4
# The tutorials are run whenever the site is built; one that fails stops the build.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
html_theme = "furo"
html_title = f"vibro {release}"
html_copy_source = False
html_show_copyright = False
html_static_path = ["site.css"]
html_css_files = ["site.css"]
# The tables of options have commands outside backticks: hyphens and quotation marks stay as typed.
smartquotes = False


def setup(app: Sphinx) -> None:
    """Let the lines of cron stand as they are: Pygments does not know their language."""
    app.add_lexer("crontab", TextLexer)
