"""The program: `selector`, or `python -m selector` where that is not on the PATH."""

import sys

try:
    from selector.cli import main
except KeyboardInterrupt:
    # a Ctrl-C while it is still loading
    sys.stderr.write("selector: stopped. Nothing was written.\n")
    sys.exit(130)

if __name__ == "__main__":
    main()
