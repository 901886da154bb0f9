"""`python -m studies.rivals`: see `trial.py`."""

import sys

from studies.rivals.trial import main

if __name__ == "__main__":
    sys.exit(main())
