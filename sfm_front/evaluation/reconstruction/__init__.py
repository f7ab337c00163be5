"""The reconstruction benchmark: scenes, rivals, accuracy, cost per photo."""
