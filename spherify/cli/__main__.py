"""``python -m spherify.cli``."""

from spherify.cli import main

if __name__ == "__main__":
    main()
