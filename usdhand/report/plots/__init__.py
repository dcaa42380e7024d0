"""Plots of results, in the manner of the papers' figures."""
