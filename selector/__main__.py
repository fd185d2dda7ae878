"""The program: `selector`, or `python -m selector` where that is not on the PATH."""

import sys


def main() -> None:
    """Runs the command line of this process and ends it; also while it is still loading, a Ctrl-C ends it quietly."""
    try:
        from selector import cli
    except KeyboardInterrupt:
        sys.stderr.write("selector: stopped. Nothing was written.\n")
        sys.exit(130)
    cli.main()


if __name__ == "__main__":
    main()
