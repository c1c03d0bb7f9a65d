"""What can be wrong with data or with a request, said in one line that tells the next step."""


class IdentificationError(Exception):
    """Anything that keeps an identification from giving a trustworthy answer."""


class RecordingError(IdentificationError):
    """Signals of the wrong shape, unit or content (missing samples among them)."""


class TooShortError(IdentificationError):
    """Fewer samples than the method needs."""


class OrderError(IdentificationError):
    """More states asked for than the data support."""


class NotSecondOrderError(IdentificationError):
    """Mass, damping and stiffness cannot be recovered from this layout or model."""
