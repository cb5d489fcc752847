"""The vehicle's files: trees on disk or in memory, FTP, log download, the flight log."""
