"""The program: `selector`, or `python -m selector` where that is not on the PATH."""

import os

try:
    from selector.cli import main
except KeyboardInterrupt:
    # a Ctrl-C while it is still loading; of one in a text that is executed, `sys.exit` would make a death by SIGINT
    os.write(2, b"selector: stopped. Nothing was written.\n")
    os._exit(130)

if __name__ == "__main__":
    main()
