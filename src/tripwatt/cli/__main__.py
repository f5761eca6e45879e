"""`python -m tripwatt.cli` is the command `tripwatt`."""

from tripwatt.cli import main

if __name__ == "__main__":
    main()
