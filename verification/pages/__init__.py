"""The former place of `verification.charts`."""
