"""What do more processes bring to a study, and what does killing them cost it?

The work is in `bench/scaling.py`.
"""

import sys

from bench.scaling import main

if __name__ == "__main__":
    sys.exit(main())
