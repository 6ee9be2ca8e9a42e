"""`python -m verification`."""

import sys

from lacmesh.__main__ import start

sys.exit(start("verification"))
