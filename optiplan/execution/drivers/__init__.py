"""Drivers: how set-points come to a robot, and its states back; `optiplan.simulation.real_time` has that of MuJoCo."""
