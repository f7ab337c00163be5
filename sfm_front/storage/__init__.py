"""Files and databases: written whole or not at all."""
