"""How small may an effect be and still be named? Its strength swept, beside an oracle.

The work is in `bench/limits/trial.py`.
"""

import sys

from bench.limits.trial import main

if __name__ == "__main__":
    sys.exit(main())
