"""`python -m tools.pages PAGE FOLDER`: writes into FOLDER what of PAGE comes from the code: tables and pictures."""

import sys
from importlib import import_module
from pathlib import Path


def main() -> int:
    """Write as the command line says; 1 if what was flown for the page did not go well."""
    page, folder = sys.argv[1:]
    return 0 if import_module(f"tools.pages.{page}").write(Path(folder)) is not False else 1


if __name__ == "__main__":
    sys.exit(main())
