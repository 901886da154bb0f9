"""`python -m studies.rivals.tuning`: see `bench/rivals/tuning.py`."""

import sys

from bench.rivals.tuning import main

if __name__ == "__main__":
    sys.exit(main())
