"""The control-law interface and registry, the loop that runs a law, profiles, the QP solver; the one-file law."""
