"""Pages of reference: the command line, keys of files, columns of logs, messages, the Python interface."""
