"""`python -m selector`: the command line where the program `selector` is not on the PATH."""

from selector.cli import main

if __name__ == "__main__":
    main()
