"""Which network to take for which use, material by material: a page.

The work is in `bench/architectures/page.py`.
"""

import sys

from bench.architectures.page import main

if __name__ == "__main__":
    sys.exit(main())
