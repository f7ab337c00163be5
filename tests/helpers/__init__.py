"""Scenes, photos and models for tests."""
