"""Errors that a user can cause. Each message says what was expected, what came, and where."""


class D4cadError(Exception):
    """Base of every error that d4cad raises on purpose; the command line prints it and exits with 2."""


class InputError(D4cadError, ValueError):
    """A picture, an array, an option or a program file that cannot be used."""


class GrammarError(D4cadError, ValueError):
    """A program or rewrite that its grammar does not allow."""


class GeometryError(D4cadError, ValueError):
    """A loop or sketch that bounds no region: open, crossing, degenerate or not finite."""


class ExportError(D4cadError, RuntimeError):
    """A file that could not be written, or a CAD kernel that is missing or failed."""
