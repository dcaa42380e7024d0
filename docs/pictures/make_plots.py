"""The plots shown in docs/plots.md.

usage: python docs/pictures/make_plots.py (needs matplotlib)
"""

import tempfile
from pathlib import Path

from PIL import Image

from usdhand.cli.main import main as usdhand

ROOT = Path(__file__).resolve().parents[2]
TALKS, HANDS = ROOT / "samples" / "conversations", ROOT / "samples" / "hands"
BODY = TALKS / "talk_01_body.usdc"
PINS = ("--pin", "1:1", "--pin", "181:403")
# As PNG what would be larger as SVG.
SHOWN = (
    "reduce_followers.png",
    "reduce_errors.svg",
    "fill_graph_left.svg",
    "evaluate_confusion.svg",
    "splice_path_left.png",
)


def main() -> None:
    """Run the verbs on the samples and keep some of their plots."""
    pictures = ROOT / "docs" / "pictures" / "plots"
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        library, out = folder / "gestures.usdc", ("-q", "-n", "-o", folder / "out.usda")
        run("library", "build", ROOT / "samples" / "gestures", "-q", "-o", library)
        run("reduce", TALKS / "talk_01_full.usdc", *out, "--plots", folder)
        run("fill", BODY, "--library", library, *out, "--side", "left", "--plots", folder)
        run("evaluate", library, "--labels-only", "-q", "--plots", folder)
        run("splice", BODY, HANDS / "talk_01_hands_a.usdc", *PINS, *out, "--plots", folder)
        pictures.mkdir(exist_ok=True)
        for name in SHOWN:
            if name.endswith(".png"):  # 64 colours are enough
                Image.open(folder / name).convert("RGB").quantize(64).save(pictures / name)
            else:
                (pictures / name).write_bytes((folder / name).read_bytes())
            print(f"{name}: {(pictures / name).stat().st_size / 1000:.0f} kB")


def run(*arguments: object) -> None:
    """Run a verb."""
    usdhand([str(a) for a in arguments], standalone_mode=False)


if __name__ == "__main__":
    main()
