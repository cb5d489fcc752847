"""`python -m tools.pages PAGE FOLDER`: write the tables and pictures of PAGE that come from the code into FOLDER."""

import sys
from importlib import import_module
from pathlib import Path


def main() -> int:
    """Return 1 if the page's flights did not go well."""
    page, folder = sys.argv[1:]
    return 0 if import_module(f"tools.pages.{page}").write(Path(folder)) is not False else 1


if __name__ == "__main__":
    sys.exit(main())
