"""How the figures and tables of these pages are made; `make_figures.py` is the command."""
