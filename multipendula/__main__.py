"""`python -m multipendula` and the installed command: Ctrl-C is answered from the first import on."""

import sys


def main() -> int:
    """Run one command and return its exit code."""
    try:
        from multipendula import cli
    except KeyboardInterrupt:
        sys.stderr.write("multipendula: interrupted\n")
        return 130
    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
