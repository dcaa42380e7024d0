"""Method 3: splice a hand clip onto a body clip (Majkowska, Zordan & Faloutsos 2006)."""

from usdhand.splice.band import Pin
from usdhand.splice.method import PAPER, Alignment, Spliced, SpliceSettings, splice

__all__ = ["PAPER", "Alignment", "Pin", "SpliceSettings", "Spliced", "splice"]
