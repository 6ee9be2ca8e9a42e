"""Meshes made by the harness: slave and master do not match, by construction."""
