"""Whether Colibri can fly on this computer: packages, machine code, ports, network, speed; and what to do if not."""

__all__: list[str] = []  # the command line's; nothing to import
