"""`python -m optiplan`: the command line, where `optiplan` itself is not on the path."""

from optiplan.cli.main import main

if __name__ == "__main__":
    main()
