"""Reconstructions measured: scenes, rivals, accuracy, cost of a photo."""
