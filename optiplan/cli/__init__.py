"""The command line: one file a command, `main` ties them together; stdout is for results, stderr for all else."""
