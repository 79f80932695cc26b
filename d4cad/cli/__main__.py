"""`python -m d4cad.cli`."""

from d4cad.cli import main

main()
