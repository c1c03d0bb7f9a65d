"""Diagnosis from spectra: recordings without measured forces, and frequency responses."""
