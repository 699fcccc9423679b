"""The schema of a problem file: its keys, and the checks that need nothing but the file itself."""
