"""What is missing from simulations of real recordings, and does the literature agree?

The work is in `bench/recordings/trial.py`.
"""

import sys

from bench.recordings.trial import main

if __name__ == "__main__":
    sys.exit(main())
