"""`python -m tools` is `colibri`."""

import sys

from tools.cli import main

sys.exit(main())
