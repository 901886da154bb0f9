"""`python -m studies.recordings`: see `trial.py`."""

import sys

from studies.recordings.trial import main

if __name__ == "__main__":
    sys.exit(main())
