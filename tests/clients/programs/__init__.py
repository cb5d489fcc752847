"""Programs of clients, each run in a process of its own as its user would run it."""
