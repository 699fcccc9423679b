"""Pairs of links that touch in many configurations: mostly those that overlap as they are built."""

from optiplan.robot.robot import Robot
from optiplan.robot.urdf.srdf import LinkPair

OFTEN = 0.2
"""Share of configurations in which links touch that are built so, more likely than not: the robot can hardly move."""


def touching_pairs(robot: Robot) -> list[LinkPair]:
    """Return the checked pairs of links that touch in more than `OFTEN` of the configurations, the most often first."""
    rates = {pair: rate for pair, rate in robot.survey.rates.items() if rate > OFTEN and pair not in robot.allowed}
    return sorted(rates, key=lambda pair: (-rates[pair], pair))
