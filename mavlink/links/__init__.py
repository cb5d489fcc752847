"""Endpoints by URL: non-blocking UDP and TCP sockets and serial ports."""
