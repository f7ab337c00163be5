"""From a folder to decoded photos and their cameras."""
