"""The command line: one thin file a verb. The only package that imports click."""

from usdhand.cli.main import main

__all__ = ["main"]
