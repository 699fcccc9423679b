"""What rounding may cost in proofs, by quantity."""

CLEARANCE_ROUNDING = 1e-9
"""m, subtracted from every proved clearance, and by which boxes are larger than what they hold."""

LARGEST = 1e5
"""rad or m: with larger terms of a polynomial, and larger bodies, rounding would eat up `CLEARANCE_ROUNDING`."""

POSITION_ROUNDING = 1e-9
"""rad or m, on top of the tolerances of goals, vias and constraints of joints."""

TORQUE_ROUNDING = 1e-12
"""Of inverse dynamics: a share of the sum of the sizes of all moments that add up to a torque."""
