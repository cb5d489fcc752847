"""Build hook: refuse a checkout without symbolic links."""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

LINKED = ("autopilot", "common", "mavlink", "plant")


class WholeCheckout(BuildHookInterface[Any]):
    """Hatchling calls `initialize` before each build."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        for name in LINKED:
            if not (Path(self.root) / "colibri" / name).is_dir():
                raise SystemExit(
                    f'colibri: colibri/{name} must be a link to the folder "{name}", but this checkout has no symbolic '
                    "links: git config core.symlinks true && git checkout -- colibri"
                )
