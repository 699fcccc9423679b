"""The program `optiplan`, also as `python -m optiplan`: Ctrl-C ends it at once, from its first line on."""

import signal


def main() -> None:
    """Run the program on the arguments of this process and end it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # before the imports, in which Python would print where it was
    from optiplan.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
