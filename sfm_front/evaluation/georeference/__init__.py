"""How soon real scenes are metric, how exactly, and whether what is said holds."""
