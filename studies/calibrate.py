"""Which constants make the posterior mean what it says? Fitted to development cases.

The work is in `bench/calibrate.py`.
"""

import sys

from bench.calibrate import main

if __name__ == "__main__":
    sys.exit(main())
