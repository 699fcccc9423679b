"""Figures of runs for papers and lectures: joints, tool and path against time and in space, as PNG, SVG, PDF, CSV."""
