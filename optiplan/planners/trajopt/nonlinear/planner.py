"""`casadi`: the curves of `trajopt`, optimised by solvers of CasADi's nonlinear programs."""

from optiplan.planners.trajopt.nonlinear.options import CasadiOptions
from optiplan.planners.trajopt.planner import TrajOpt


class CasadiPlanner(TrajOpt):
    """The search of `trajopt` over the same curves; each step of a descent is one nonlinear program of CasADi.

    Limits of joints, torques, path constraints and objectives enter it as expressions with exact derivatives,
    distances linearised at the curve, inside a trust region. See `nonlinear.trajectory_nlp`.
    """

    Options = CasadiOptions
