"""The vehicle's files and how they travel: trees on disk or in memory, FTP, log download, the flight log."""
