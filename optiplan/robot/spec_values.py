"""Names and lengths in a robot.yaml, which its keys and those of a table of joints share."""

from typing import Annotated

from pydantic import Field

Name = Annotated[str, Field(min_length=1)]
"""The name of a joint, a link or a file."""

Length = Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=False)]
"""A number > 0, m."""
