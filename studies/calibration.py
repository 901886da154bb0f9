"""Fit the virtual specimens to the published tables and store the parameters.

The work is in `bench/calibration.py`.
"""

import sys

from bench.calibration import main

if __name__ == "__main__":
    sys.exit(main())
