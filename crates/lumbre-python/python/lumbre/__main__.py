"""`python -m lumbre` is the program `lumbre`."""

from ._program import main

main()
