"""What can go wrong in the lab, said in one line that tells the next step."""


class LabError(Exception):
    """A mistake in what the lab was given; shown as one line, exit status 2."""


class RigError(LabError):
    """A structure or measurement chain that cannot be built or simulated."""


class StudyError(LabError):
    """A scenario or study file with a wrong key or value."""


class FileError(LabError):
    """A file that is missing, damaged or of another format."""


class UnknownNameError(LabError):
    """A name that does not exist; the message lists those that do."""


class DivergedError(LabError):
    """A simulation whose state is no longer finite."""
