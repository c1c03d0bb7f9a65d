"""`python -m lab`, the same as `lab`."""

from lab.cli import main

# Workers of a cluster import this module too, under another name.
if __name__ == "__main__":
    main()
