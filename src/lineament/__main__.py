"""The command ``lineament``, also as ``python -m lineament``."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C while it is imported is one line, too."""
    try:
        from .cli import main
    except KeyboardInterrupt:
        print("lineament: stopped", file=sys.stderr)
        sys.exit(130)
    main()


if __name__ == "__main__":
    main()
