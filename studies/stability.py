"""Do the names hold when recordings are hardly changed, or have half the noise?

The work is in `bench/stability.py`.
"""

import sys

from bench.stability import main

if __name__ == "__main__":
    sys.exit(main())
