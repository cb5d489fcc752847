"""The command line: one file per subcommand with its options and its call."""

__all__: list[str] = []  # the command line's; nothing to import
