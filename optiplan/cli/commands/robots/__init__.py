"""The commands of `optiplan robots`."""
