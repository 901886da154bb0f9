"""Real recordings: does anything that a user would pick instead predict better?

The work is in `bench/rivals/trial.py`.
"""

import sys

from bench.rivals.trial import main

if __name__ == "__main__":
    sys.exit(main())
