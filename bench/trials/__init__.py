"""A trial: cases that somebody else made, sealed, diagnosed, opened, scored, reported.

Cases come from `bench.hands` or from a folder; a trial knows nothing else of them than
what a truth file says.

    sealing.py      truths on disk, the seal, what is done before it is broken
    trial.py        the command: have cases made, diagnose, open, score, report
    acting.py       where what was concealed acts
    located.py      regions and gains, counted
    held.py         what models predict of recordings that stayed with the truth
    noise_check.py  noise as softnn reads it, where the exact truth is known
    reporting.py    tables, confusion matrix, result file, MLflow

Scored by `bench/scoring.py`; what is opened is in `studies/results/ledger.json`.
"""
