"""Endpoints by URL: UDP and TCP sockets that never block; the only sockets."""
