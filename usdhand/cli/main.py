"""The `usdhand` command: verbs are imported only when they are called."""

from __future__ import annotations

from typing import Any

import click

from usdhand.cli.command import command_of
from usdhand.cli.console import complain, foreseen
from usdhand.cli.interrupt import Interrupt, end_interrupted
from usdhand.errors import UsdHandError
from usdhand.requests.verbs import GROUPS, VERBS
from usdhand.version import __version__


class VerbGroup(click.Group):
    """Loads verbs late, and turns our errors into one message and an exit code."""

    def __init__(self, *args: Any, prefix: str = "", **details: Any) -> None:
        super().__init__(*args, **details)
        self.prefix = prefix  # "library " for the verbs of that group

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Verbs in the order of the work, one that is a group of verbs once."""
        del ctx
        own = [v.removeprefix(self.prefix) for v in VERBS if v.startswith(self.prefix)]
        return list(dict.fromkeys(verb.split()[0] for verb in own))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a verb's options."""
        if cmd_name not in self.list_commands(ctx):
            return None
        verb = self.prefix + cmd_name
        if verb in GROUPS:
            return VerbGroup(cmd_name, prefix=f"{verb} ", help=GROUPS[verb])
        return command_of(verb)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the verbs without importing them."""
        with formatter.section("Verbs"):
            names = [(name, self.prefix + name) for name in self.list_commands(ctx)]
            formatter.write_dl([(n, GROUPS.get(v) or VERBS[v][1]) for n, v in names])

    def invoke(self, ctx: click.Context) -> Any:
        """Run a verb; what a person can mend ends in a message, not in a traceback."""
        try:
            return super().invoke(ctx)
        except UsdHandError as error:
            complain(f"Error: {error}")
            ctx.exit(error.exit_code)
        except KeyboardInterrupt:
            end_interrupted()
        except (click.ClickException, click.exceptions.Exit, click.Abort, BrokenPipeError):
            raise  # click's own ways out
        except Exception as error:
            if Interrupt.came:
                end_interrupted()
            if ctx.find_root().params.get("debug"):
                raise
            complain(f"Error: {foreseen(error)}")
            ctx.exit(1)


@click.group(cls=VerbGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="usdhand")
@click.option("--debug", is_flag=True, help="Show the traceback of an unexpected error.")
def main(debug: bool) -> None:
    """Hands for digital characters, over OpenUSD.

    Exit codes: 0 ok, 1 failed or a check failed, 2 usage, 3 unreadable or unsupported input,
    4 no hand or an ambiguous one, 5 a quality limit was not met, 130 interrupted.
    """
    del debug  # read by VerbGroup.invoke
