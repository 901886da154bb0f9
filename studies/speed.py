"""How fast is softnn, against what a user would otherwise pick, in the same run?

The work is in `bench/speed.py`.
"""

import sys

from bench.speed import main

if __name__ == "__main__":
    sys.exit(main())
