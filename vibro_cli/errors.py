"""What every error of the package that a caller may meet has in common."""


class VibroError(Exception):
    """The base of all errors that say something about a scenario, a run, a grid or a folder.

    Those there are can be imported from ``vibro_cli``; a wrong argument of a function is a
    ``ValueError`` or ``TypeError``, a file that cannot be read or written an ``OSError``.
    """


class NoLibrary(VibroError, RuntimeError):
    """There is no library of kernels for this machine; the message says what to do."""
