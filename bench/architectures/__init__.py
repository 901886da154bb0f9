"""One search a material over networks: its trials, its front, what stands beside."""
