"""Published retrieval datasets in their published layout, and pools of scenes."""
