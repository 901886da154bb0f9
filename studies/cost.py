"""What does a diagnosis cost, against the number of samples and of candidate effects?

The work is in `bench/cost.py`.
"""

import sys

from bench.cost import main

if __name__ == "__main__":
    sys.exit(main())
