"""Edit hands reduced by usdhand in Blender: free channels as sliders, dependents follow.

Licence: Apache-2.0, as usdhand.
"""

from . import interface


def register() -> None:
    """Called by Blender when the add-on is enabled."""
    interface.register()


def unregister() -> None:
    """Called by Blender when the add-on is disabled."""
    interface.unregister()
