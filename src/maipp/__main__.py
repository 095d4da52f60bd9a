"""`python -m maipp` is the `maipp` command."""

import sys

from maipp.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
