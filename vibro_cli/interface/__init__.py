"""The Python interface: what ``import vibro_cli`` offers, by what it is about."""

import logging

# Whoever imports the package decides whether its messages are shown.
logging.getLogger("vibro_cli").addHandler(logging.NullHandler())
