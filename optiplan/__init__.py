"""OptiPlan: one YAML file in, one trajectory out that is proved collision-free and within limits."""

__version__ = "0.1.0"
