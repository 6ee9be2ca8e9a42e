"""Rules that doubt a run: what may be wrong in its pairs, its steps and its results (`rules.WHEN` lists them)."""
