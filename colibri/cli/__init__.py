"""The one command: a file a subcommand, each with its options and its call."""

__all__: list[str] = []  # the command line's; nothing to import
