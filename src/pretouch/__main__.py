"""Make `python -m pretouch` run the command `pretouch`."""

from pretouch.cli import main

if __name__ == "__main__":
    main()
