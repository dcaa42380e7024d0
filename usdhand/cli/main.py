"""The `usdhand` command: verbs are imported only when they are called."""

from __future__ import annotations

import importlib
from typing import Any

import click

from usdhand.errors import UsdHandError
from usdhand.version import __version__

# Verb -> (module, one line of help). Kept here so that `--help` imports no verb.
VERBS = {
    "inspect": "Show skeletons, timing, units, hands and problems of files.",
    "reduce": "Reduce hands to a rig of a few free channels.",
    "expand": "Turn a reduced rig back into motion, on its own or another character.",
    "library": "Build a motion library, and show what is in one.",
    "fill": "Give a body clip the fingers of similar motions from a library.",
    "splice": "Put the fingers of a hand clip on a body clip, retimed to it.",
    "evaluate": "Measure how well a library tells fingers from arms.",
    "compare": "Compare two motions: degrees, fingertips, smoothness, lag.",
    "convert": "Convert between USD, BVH, glTF and FBX; put fingers on other characters.",
    "preview": "Make a page to look at clips with in a browser.",
    "check": "Check files with UsdValidation and rules of our own.",
    "schema": "Print the folder of the USD schema for PXR_PLUGINPATH_NAME.",
}


class VerbGroup(click.Group):
    """Loads verbs late, and turns our errors into one message and an exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Verbs in the order of the work."""
        del ctx
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a verb's module."""
        del ctx
        if cmd_name not in VERBS:
            return None
        module = importlib.import_module(f"usdhand.cli.{cmd_name}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the verbs without importing them."""
        del ctx
        with formatter.section("Verbs"):
            formatter.write_dl(list(VERBS.items()))

    def invoke(self, ctx: click.Context) -> Any:
        """Run a verb; what a person can mend ends in a message, not in a traceback."""
        try:
            return super().invoke(ctx)
        except UsdHandError as error:
            click.echo(f"Error: {error}", err=True)
            ctx.exit(error.exit_code)


@click.group(cls=VerbGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="usdhand")
def main() -> None:
    """Hands for digital characters, over OpenUSD.

    Exit codes: 0 ok, 1 failed or a check failed, 2 usage, 3 unreadable or unsupported input,
    4 no hand or an ambiguous one, 5 a quality limit was not met.
    """
