"""Scenes as if their photos had been taken through other lenses."""
