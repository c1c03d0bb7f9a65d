"""Tests of the two packages, laid out like them."""
