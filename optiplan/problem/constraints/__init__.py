"""Path constraints: their statements, and what they measure."""
