"""Reports on finished runs: a page of HTML that needs nothing else, and two runs compared.

folder of a run -> results.json, history.csv, fields at some times      (lacsolver.output)
blocks of a page: figures, the turning model, zones, curves, loads, the case       (`outline`, `model`)
"""
