"""The command line: one file per subcommand."""

__all__: list[str] = []  # the command line's; nothing to import
