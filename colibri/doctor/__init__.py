"""Check that Colibri can fly on this computer: packages, machine code, ports, network, speed."""

__all__: list[str] = []  # the command line's; nothing to import
