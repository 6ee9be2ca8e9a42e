"""Faces, the cells behind them, their components and their winding."""
