"""Batches of runs: one problem in a worker, the rows of all in Parquet, the verified ones as a LeRobot data set."""
