"""Make the figures of the design studies of the SRRA: `python docs/pictures/make_design.py`.

* `design-lengths.svg`: `examples/design_srra.yaml`, reached volume against torque.
* `design-base.svg`: `examples/design_srra_base.yaml`, side of the foot against mass of the base.

Prints the rows that `docs/theory/reports.md` has. Takes a few minutes.
"""

from pathlib import Path

import optiplan as op
from optiplan.figure_style import styled, svg_of
from optiplan.viewer.plots.design_front import draw_front

HERE = Path(__file__).parent.resolve()
EXAMPLES = HERE.parent.parent / "examples"


def main() -> None:
    """Run both studies and draw their fronts."""
    for name, study in (("lengths", "design_srra.yaml"), ("base", "design_srra_base.yaml")):
        found = op.design(EXAMPLES / study)
        print(found.csv)
        with styled():
            (HERE / f"design-{name}.svg").write_text(svg_of(draw_front(found)), encoding="utf-8")


if __name__ == "__main__":
    main()
