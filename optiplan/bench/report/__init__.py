"""The report of a suite: one page, its figures, a table for READMEs."""
