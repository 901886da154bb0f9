"""`python -m studies.concealed`: see `trial.py`."""

from studies.concealed.trial import main

raise SystemExit(main())
