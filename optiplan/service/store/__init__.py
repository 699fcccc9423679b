"""What the service keeps: problems, runs and their events in a database, contents in files named by their digest."""
