"""The pages docs/proof*.md, made from studies/results alone."""
