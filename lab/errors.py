"""What can be wrong with what the user hands to the lab, said in one line that tells the next step."""


class LabError(Exception):
    """Anything the user can put right: a file, a name, a scenario."""


class FileError(LabError):
    """A file or folder that cannot be read, is not what it claims to be, or cannot be written."""


class RigError(LabError):
    """A model that MuJoCo does not compile, or that does not fit the request."""


class StudyError(LabError):
    """A scenario or study file with an unknown key or an impossible value."""


class UnknownNameError(LabError):
    """A name that does not exist; the message lists those that do."""


class DivergedError(LabError):
    """A simulation that left the finite numbers."""
