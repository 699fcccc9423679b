"""The program of one descent: what a curve costs and holds, its steps, in Python and in the native core."""
