"""What `schema` is to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from usdhand.display import displayed
from usdhand.options import option
from usdhand.requests.base import Request


@displayed()
@dataclass(frozen=True, kw_only=True)
class SchemaRequest(Request):
    """Print the folder of the USD schema for PXR_PLUGINPATH_NAME, or a JSON schema.

    Rigs read the same without the USD schema; with it, USD tools show the types of a rig. The JSON
    schemas are those of reports and of the requests that reports and manifests hold.

    \b
    Examples:
      export PXR_PLUGINPATH_NAME=$(usdhand schema)
      usdhand schema --of-report fill > fill.schema.json
    """

    verb: ClassVar[str] = "schema"
    of_report: str | None = option(
        "Print the JSON schema of a verb's reports.", default=None, metavar="VERB"
    )
    of_request: str | None = option(
        "Print the JSON schema of a verb's requests.", default=None, metavar="VERB"
    )
    of_failure: bool = option(
        "Print the JSON schema of reports of runs that failed as a whole.", default=False
    )
    of_edits: bool = option("Print the JSON schema of files of edits.", default=False)
    of_takes: bool = option("Print the JSON schema of manifests of hand takes.", default=False)
