"""The suites again and again, and clients for minutes."""
