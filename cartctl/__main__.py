"""``python -m cartctl``: the command line without its script on the PATH."""

from cartctl.cli import main

if __name__ == "__main__":
    main()
