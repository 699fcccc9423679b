from tests.problem.conftest import arm  # noqa: F401  # the same arm
