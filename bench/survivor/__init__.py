"""Networks of histories beside others: problems, networks, scores, a page."""
