"""``python -m lineament``."""

from .cli import main

main()
