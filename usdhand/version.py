"""The version of usdhand, in one place."""

__version__ = "0.1.0"
