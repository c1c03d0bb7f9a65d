"""The tables of the founding papers, recomputed."""
