"""Scenes, photos and models that tests are made with."""
