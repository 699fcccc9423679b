"""The commands of `optiplan bench`."""
