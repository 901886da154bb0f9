"""Makers and judges of trials: what studies put `softnn diagnose` and its rivals to."""
