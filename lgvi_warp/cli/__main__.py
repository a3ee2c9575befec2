"""`python -m lgvi_warp.cli` is the command."""

from lgvi_warp.cli import entry

if __name__ == "__main__":
    entry()
