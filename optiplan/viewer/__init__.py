"""See a run in a browser: a meshcat scene inside our own page, served locally or written as one file."""
