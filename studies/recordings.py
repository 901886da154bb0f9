"""`python -m studies.recordings`: see `bench/recordings/trial.py`."""

import sys

from bench.recordings.trial import main

if __name__ == "__main__":
    sys.exit(main())
