"""Which joint is which in a character's rig, and finger joints for a rig that has none.

`mapping` decides; what it decides between is proposed by

- `by_map_file`: joints that a user named one by one;
- `by_names`: the naming convention (`conventions`, ``conventions.toml``) that fits best, of all
  that are laid over the names (`joint_names`, `convention_match`), with one joint chosen for each
  role (`choose_joints`), and sides for names that have none (`unsided`);
- `by_shape`: hierarchy and bind pose alone, with sides from all that tells them (`sides`).

`body` finds arms, spine and legs, `height` measures the character. `fingerless` finds arms that end
without fingers, and `graft` gives them those of another character.
"""

from usdhand.rigs.conventions import Conventions, load_conventions
from usdhand.rigs.mapping import map_character

__all__ = ["Conventions", "load_conventions", "map_character"]
