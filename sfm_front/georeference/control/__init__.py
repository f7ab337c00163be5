"""Surveyed points with marks in photos hold a model where it lies in the world."""
