"""`python -m studies.concealed`: see `bench/trials/trial.py`."""

import sys

from bench.trials.trial import main

if __name__ == "__main__":
    sys.exit(main())
