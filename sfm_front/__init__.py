"""Structure-from-Motion that keeps up with the camera."""

__version__ = "0.1.0"
