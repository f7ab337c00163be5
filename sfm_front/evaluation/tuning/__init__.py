"""Tuned options tried again: other values of them, on many scenes, in several orders."""
