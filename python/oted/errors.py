"""What oted raises. Each message is one line: what, got, wanted, where, remedy."""


class Error(Exception):
    """Any of these."""


class UsageError(Error, ValueError):
    """The request is wrong: an unknown key, a value outside its range, a missing argument."""


class DataError(Error, ValueError):
    """The data, the model or the file system does not allow what was asked."""


class Interrupted(Error):
    """The work was stopped; what was complete is on disk, and the same call goes on from there."""


class InternalError(Error, RuntimeError):
    """A bug in oted."""


class MissingPackage(UsageError, ImportError):
    """An optional package is needed; the message has the pip line."""
