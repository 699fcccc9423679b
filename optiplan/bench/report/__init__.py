"""What a suite's runs say: one page, its figures, a table for READMEs."""
