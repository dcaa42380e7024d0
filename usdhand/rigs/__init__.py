"""Which joint is which: names, shape, roles of arm and trunk; finger joints to add."""

from usdhand.rigs.conventions import Conventions, load_conventions
from usdhand.rigs.mapping import map_character

__all__ = ["Conventions", "load_conventions", "map_character"]
