"""Does the recording that softnn asks for settle what it could not tell?

The work is in `bench/loop.py`.
"""

import sys

from bench.loop import main

if __name__ == "__main__":
    sys.exit(main())
