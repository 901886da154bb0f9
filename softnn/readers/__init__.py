"""File -> Recording: one dialect a file; the only place where units change."""
