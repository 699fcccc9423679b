"""The one representation of motion, piecewise polynomials in time, and ways to time a path."""
