"""The command line: one thin file a verb. The only package that imports click."""

from usdhand.cli.entry import main

__all__ = ["main"]
