"""Threads, devices and clocks; knows nothing of photos."""
