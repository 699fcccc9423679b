"""Small pictures of motions for lists."""

import numpy as np

from optiplan.trajectory.trajectory import Trajectory

WIDTH, HEIGHT, POINTS = 240, 74, 60
COLOURS = ("#2374c6", "#d3761f", "#2f9e5b", "#a13bb5", "#b9302b", "#4b6a88", "#8a7a12", "#17a2a2")


def joint_curves(trajectory: Trajectory) -> str:
    """Positions of the joints over time as an SVG, each scaled by the widest range of any."""
    t = np.linspace(0.0, trajectory.duration, POINTS)
    q = trajectory(t)
    middle, span = 0.5 * (q.max(axis=0) + q.min(axis=0)), max(float(np.ptp(q, axis=0).max()), 1e-9)
    x = np.linspace(2.0, WIDTH - 2.0, POINTS)
    y = 0.5 * HEIGHT - (HEIGHT - 10.0) * (q - middle) / span
    lines = []
    for joint in range(q.shape[1]):
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y[:, joint], strict=True))
        colour = COLOURS[joint % len(COLOURS)]
        lines.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.3"/>')
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" preserveAspectRatio="none">'
    return head + "".join(lines) + "</svg>"
