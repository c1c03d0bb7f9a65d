"""Causes that a rig can hide and a diagnosis can propose: name -> effect."""

EFFECTS: dict[str, type] = {}
