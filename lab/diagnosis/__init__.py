"""Diagnosis: what a model gets wrong, why, and how much better it gets."""
