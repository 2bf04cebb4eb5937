"""`python -m pretouch` is `pretouch`."""

from pretouch.cli import main

if __name__ == "__main__":
    main()
