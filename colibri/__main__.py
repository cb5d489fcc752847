"""`colibri` is `colibri`."""

import sys

from colibri.cli.main import main

sys.exit(main())
