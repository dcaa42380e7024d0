"""What is drawn in a panel of a plot."""

from __future__ import annotations

from typing import Any


def lines(panel: Any) -> dict[str, Any]:
    """Lines of a panel by their label."""
    return {line.get_label(): line.get_xydata() for line in panel.get_lines()}
