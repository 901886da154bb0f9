r"""A forge of concealed cases: does `softnn diagnose` name the physics left out?

Nothing in here but `trial.py`, `reporting.py`, `unseen.py`, `acting.py` and
`noise_check.py` knows softnn. The
forge has its own material laws, its own integrators and its own functional form for
every effect, so that a diagnosis cannot succeed by meeting its own formulae again. One
fine uniform clock (`programmes.STEP_S`) carries all signals; what is written down is
sampled from it.

    programmes.py   what the machine is told to do, and when samples are taken
    bases.py        hyperelastic springs and Maxwell branches: the physics left in
    planting.py     what an effect is here: hooks at the stages it acts in
    rig.py, material.py, sensor.py     the nineteen effects
    unlisted.py     things that are on no list
    noises.py       noise: white, coloured, heteroscedastic, quantised
    oracle.py       what a refit absorbs, and whether the rest can be seen at all
    rivals.py       whether another effect could have made the same recordings
    orders.py       which cases: single effects, pairs, nulls, what is on no list
    settings.py     a case before anything is planted: model, machine, habits
    forge.py        a case: drawn, run, its answer beside it
    sealing.py      cases on disk, the sealed key, truths that came from elsewhere
    details.py      what only the key of this forge can tell of a diagnosis
    unseen.py       what corrected models predict of recordings beside a truth
    acting.py       where what other hands concealed acts
    noise_check.py  noise as softnn reads it, where the exact truth is known
    reporting.py    tables, confusion matrix, result file, MLflow
    trial.py        forge or take in, diagnose, open the key, score, report

Scored by `bench/scoring.py`, as every trial is; what is opened is in
`studies/results/ledger.json`.

Where an effect has a size in the specification, a test reads it off forged signals.
Those that have none: a bent spring at least doubles its tangent stiffness; branches are
two to three times as stiff, or a half to a third, at the largest strain; the inertial
stress reaches 5-12 % of the peak in the sine; a buckled strip bears at most 4 % of its
stiffness; branches of finite strain are that altogether, at strains of 0.8 to 2.2. At a
strength below 1 the last two, and the bent spring, are blended with what they replace.

The base of a case leaves nothing out but what is planted: its springs are drawn until
the best 16 straight segments leave less than chance does (`oracle.adequate`), and its
relaxation times lie between 0.3 s and 50 s, within what the recordings show.
"""
