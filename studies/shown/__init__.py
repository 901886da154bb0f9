"""How studies show what they found: their tables and figures."""
