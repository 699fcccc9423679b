"""Controllers: of the joints, and of the tasks of `optiplan.control` on top of them."""
