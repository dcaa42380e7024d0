"""Procedural characters and gestures: everything `make_samples.py` needs."""
