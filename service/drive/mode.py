"""What a drive does."""

from enum import StrEnum


class Mode(StrEnum):
    """What a drive does: it makes a map or goes on with one, or localises in one that stays as it is."""

    MAPPING = "mapping"
    LOCALIZATION = "localization"
