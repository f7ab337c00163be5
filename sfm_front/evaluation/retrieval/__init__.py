"""Retrieval measured: datasets, the paper's rivals, mean average precision."""
