"""`python -m tools.pages PAGE FOLDER`: write generated parts of PAGE."""

import argparse
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

from tools import pages


def main() -> int:
    """Return 1 if the page's flights did not go well."""
    parser = argparse.ArgumentParser(prog="python -m tools.pages", description=__doc__)
    prefix = f"{pages.__name__}."
    found = [each.name.removeprefix(prefix) for each in walk_packages(pages.__path__, prefix) if not each.ispkg]
    parser.add_argument("page", choices=[name for name in found if not name.startswith("_")])
    parser.add_argument("folder", type=Path, help="of the pages, docs")
    asked = parser.parse_args()
    try:
        module = import_module(prefix + asked.page)
    except ModuleNotFoundError as error:
        parser.error(f"{asked.page} needs {error.name}: make .venv/.more")
    write = getattr(module, "write", None)
    if not (write or hasattr(module, "PAGES")):
        parser.error(f"{asked.page} belongs to other pages, and writes none")
    for page, renewed in getattr(module, "PAGES", {}).items():
        (asked.folder / page).write_text(renewed((asked.folder / page).read_text(encoding="utf-8")), encoding="utf-8")
    return 1 if write and write(asked.folder) is False else 0


if __name__ == "__main__":
    sys.exit(main())
