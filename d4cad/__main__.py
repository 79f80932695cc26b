"""`python -m d4cad`."""

from d4cad.cli import main

main()
