"""``python -m usdhand``."""

from usdhand.cli import main

main()
