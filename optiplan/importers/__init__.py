"""Problems of other programs as problem files: MoveIt scenes and requests, data sets of MotionBenchMaker."""
