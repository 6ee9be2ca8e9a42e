"""Figures and tables of the documentation pages; `make_figures.py` is the command."""
