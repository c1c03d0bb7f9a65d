"""Blind cases: structures with something hidden in them, drawn from a seed, and what a diagnosis may know about them."""
