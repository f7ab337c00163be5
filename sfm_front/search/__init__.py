"""Search a folder of photos by photo."""
