"""OpenUSD: UsdSkel characters read into clips, results written as layers.

USD makes prototypes of instances in the order of memory addresses unless it is told otherwise
before it is loaded: equal runs would give files that differ. Its notice of being told is left out.
"""

import os as _os

_ORDERED = {"USD_ASSIGN_PROTOTYPES_DETERMINISTICALLY": "1", "TF_ENV_SETTING_ALERTS_ENABLED": "0"}
_own = {name: value for name, value in _ORDERED.items() if name not in _os.environ}
_os.environ.update(_own)
try:
    from pxr import Usd as _Usd  # noqa: F401
finally:
    for _name in _own:
        del _os.environ[_name]
