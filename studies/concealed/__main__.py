"""`python -m studies.concealed`: see `trial.py`."""

import sys

from studies.concealed.trial import main

if __name__ == "__main__":
    sys.exit(main())
