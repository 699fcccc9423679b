"""Checks of tasks: steps in time, lines, tours, tools and several arms."""
