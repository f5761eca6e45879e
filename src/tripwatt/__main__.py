"""`python -m tripwatt` is the command `tripwatt`."""

from tripwatt.command import main

if __name__ == "__main__":
    main()
