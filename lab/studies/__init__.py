"""Studies: many runs of a scenario with something varied, on as many workers as there are."""
