"""`python -m studies.concealed`: see `bench/concealed/trial.py`."""

import sys

from bench.concealed.trial import main

if __name__ == "__main__":
    sys.exit(main())
