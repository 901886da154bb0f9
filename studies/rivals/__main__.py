"""`python -m studies.rivals`: see `bench/rivals/trial.py`."""

import sys

from bench.rivals.trial import main

if __name__ == "__main__":
    sys.exit(main())
