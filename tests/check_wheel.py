"""The wheel holds what an installation needs beside modules: schema, conventions, the page."""

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

WANTED = (
    "usdhand/schemas/plugInfo.json",
    "usdhand/schemas/generatedSchema.usda",
    "usdhand/schemas/schema.usda",
    "usdhand/rigs/conventions.toml",
    "usdhand/formats/fbx/worker.py",
    "usdhand/report/preview/viewer/page.html",
    "usdhand/report/preview/viewer/three.core.min.js",
    "usdhand/report/preview/viewer/THREE-LICENSE.txt",
    "usdhand/py.typed",
)

with tempfile.TemporaryDirectory() as folder:
    build = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", folder, "."]
    subprocess.run(build, check=True, cwd=Path(__file__).parent.parent)
    [wheel] = Path(folder).glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
missing = [name for name in WANTED if name not in names]
sys.exit(f"the wheel lacks {missing}" if missing else 0)
