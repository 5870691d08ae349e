"""`python -m artiskill`: the command line, for environments whose `bin` is not on the path."""

import sys

from artiskill.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
