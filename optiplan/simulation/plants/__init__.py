"""Plants: what stands in for the real robot, from an ideal one to rigid-body dynamics and MuJoCo."""
