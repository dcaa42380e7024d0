"""Where the codeless USD schema is; needs no USD."""

from __future__ import annotations

from pathlib import Path

from usdhand.errors import UsdHandError


def schema_folder() -> Path:
    """Folder to put on ``PXR_PLUGINPATH_NAME``, so that USD knows the types of a hand rig.

    Raises
    ------
    UsdHandError
        if the installation is incomplete.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "schemas", package.parent / "schemas"):  # a wheel, a checkout
        if (folder / "plugInfo.json").is_file():
            return folder
    raise UsdHandError(f"{package}: the schemas folder is missing; install usdhand again.")
