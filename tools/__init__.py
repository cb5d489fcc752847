"""The command line: fly both processes and report, draw, measure."""
