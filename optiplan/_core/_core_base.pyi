"""What each build of the core offers; see the C++ sources for formulas."""
