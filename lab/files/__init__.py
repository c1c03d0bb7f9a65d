"""Recordings, results and output folders on disk."""
