"""What was concealed, what was found, what was not, and why: a page or two.

The work is in `bench/proof/make.py`.
"""

import sys

from bench.proof.make import main

if __name__ == "__main__":
    sys.exit(main())
