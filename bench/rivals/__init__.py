"""Rivals on the same cases: does anything else name the physics left out as well?

Every method gets the same recordings (thinned alike), the same refit of the base, the
same noise estimate, the same features or columns, and the same split: one recording
left out at a time, what belongs to it alone taken from its alternate tenths, as
`softnn.mismatch.verify` does. What is free in a method is tuned on development seeds
(`tuning.py`, `tuned.json`). The key is opened after all answers are written.

    problem.py      a case as every rival gets it
    columns.py      features, columns of the effects, and how columns become names
    folds.py        the split: the base, with or without columns, refitted in each fold
    naming.py       what a rival found, and the rule that makes names of it
    criteria.py     AIC and BIC over softnn's own effects
    sparse.py       LARS, OMP and best subsets on columns of the effects
    equations.py    PySINDy and symbolic regression on features
    prediction.py   a Gaussian process on the residual, a network of history: no names
    classifier.py   a forest on residual features that may refuse
    methods.py      all of them, in the order of the table
    extra.py        packages that may be missing
    tuning.py       thresholds, from development cases
    table.py        the table, the figure, the result file, MLflow
    trial.py        forge, answer, open the key, score
"""
