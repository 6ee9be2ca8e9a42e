"""The pages of the site that are made from the code, and the folder of sources from which Sphinx makes all of it."""
