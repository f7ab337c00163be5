"""Where the page is served: to this machine alone."""

from __future__ import annotations

HOST = "127.0.0.1"
FIRST_PORT = 8080
"""Ports are tried from here on."""
