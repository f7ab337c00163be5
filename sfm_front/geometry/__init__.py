"""Angles, poses and rigs."""
