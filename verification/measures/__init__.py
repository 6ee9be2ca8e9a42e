"""Errors against exact fields, and how fast they fall."""
