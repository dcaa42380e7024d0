"""Print the lowest versions that pyproject.toml allows, as constraints for pip."""

import re
import sys
import tomllib
from pathlib import Path

project = tomllib.loads(Path("pyproject.toml").read_text())["project"]
extras = (project["optional-dependencies"][name] for name in ("convert", "plots", "test"))
for requirement in (*project["dependencies"], *(each for extra in extras for each in extra)):
    if found := re.match(r"([\w.-]+)>=([\w.]+)", requirement):
        sys.stdout.write(f"{found[1]}=={found[2]}\n")
