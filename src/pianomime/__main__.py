"""`python -m pianomime`: the same as the command `pianomime`."""

from pianomime.cli import main

if __name__ == "__main__":
    main()
