"""`python -m tools.pages PAGE FOLDER`: write generated parts of PAGE."""

import sys
from importlib import import_module
from pathlib import Path


def main() -> int:
    """Return 1 if the page's flights did not go well."""
    name, folder = sys.argv[1], Path(sys.argv[2])
    module = import_module(f"tools.pages.{name}")
    for page, renewed in getattr(module, "PAGES", {}).items():
        (folder / page).write_text(renewed((folder / page).read_text(encoding="utf-8")), encoding="utf-8")
    return 1 if hasattr(module, "write") and module.write(folder) is False else 0


if __name__ == "__main__":
    sys.exit(main())
