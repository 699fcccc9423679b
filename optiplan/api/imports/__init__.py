"""Files of other programs as files of OptiPlan: robots and scenes."""
