"""`python -m multipendula` and the installed command: Ctrl-C is answered from the first import on."""

import sys
from importlib.util import find_spec

NAMESAKE = (
    "multipendula: the package 'modal' does not belong to multipendula or is incomplete: the Modal cloud client, "
    "whose distribution is also called 'modal', has overwritten or removed its files\n"
    "multipendula: give each its own virtual environment, or repair this one: "
    "pip uninstall modal multipendula, then install multipendula again\n"
)


def main() -> int:
    """Run one command and return its exit code."""
    try:
        if not _has_own_modal():
            sys.stderr.write(NAMESAKE)
            return 1
        from multipendula import cli
    except KeyboardInterrupt:
        sys.stderr.write("multipendula: interrupted\n")
        return 130
    return cli.main()


def _has_own_modal() -> bool:
    """Whether the package `modal` is ours, judged by its source: another one may fail on import."""
    spec = find_spec("modal")
    read = getattr(spec and spec.loader, "get_data", None)
    return bool(spec and spec.origin and read and b"natural_modes" in read(spec.origin))


if __name__ == "__main__":
    sys.exit(main())
