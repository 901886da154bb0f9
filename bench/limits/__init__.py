"""How small an effect may be: a grid of strengths and noises beside an oracle."""
