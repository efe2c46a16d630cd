"""`python -m regolithd` is `regolithd`."""

from regolithd.daemon.cli import main

if __name__ == "__main__":
    main()
