"""The command line: one module per command, joined by `main`; results go to stdout, everything else to stderr."""
