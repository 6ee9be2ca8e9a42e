"""`python -m lacmesh`: the command."""

import sys

from lacmesh.cli import main

sys.exit(main())
