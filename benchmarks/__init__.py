"""Speed and memory against references that are timed in the same run: `python -m benchmarks.NAME`."""
