"""`python -m daemon` is `regolithd`."""

from daemon.cli import main

if __name__ == "__main__":
    main()
