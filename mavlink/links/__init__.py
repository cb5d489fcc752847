"""Endpoints by URL: UDP and TCP sockets and serial ports that never block; the only sockets."""
