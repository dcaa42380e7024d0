"""usdhand schema."""

from __future__ import annotations

import click


@click.command("schema")
def command() -> None:
    """Print the folder of the USD schema for PXR_PLUGINPATH_NAME.

    Rigs read the same without it; with it, USD tools show the types of a rig.

    \b
    Example:
      export PXR_PLUGINPATH_NAME=$(usdhand schema)
    """
    from usdhand.formats.schema import schema_folder

    click.echo(schema_folder())
