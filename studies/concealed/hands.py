"""`python -m studies.concealed.hands`: see `bench/hands`."""

from bench.hands.__main__ import main

if __name__ == "__main__":
    main()
