"""The tables of a report: made once, shown in the page, and written as CSV and LaTeX."""
