"""How fast are the models? Simulation of branches, and a whole fit, on one core.

The work is in `bench/speed_models.py`.
"""

import sys

from bench.speed_models import main

if __name__ == "__main__":
    sys.exit(main())
