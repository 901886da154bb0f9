"""One question a module: `python -m studies.NAME`, `--smoke` in seconds."""
