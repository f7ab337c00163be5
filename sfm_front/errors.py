"""The mistakes a user can make, each with a way out."""


class SfmFrontError(Exception):
    """A mistake the user can mend. The message says what, where, and what to do now."""


class ConfigError(SfmFrontError):
    """An option has a value it cannot have."""


class InputError(SfmFrontError):
    """A folder, file or model given by the user cannot be used."""


class WeightsError(SfmFrontError):
    """A weights file is missing, broken, or belongs to another network."""


class DependencyError(SfmFrontError):
    """A library that this command needs cannot be loaded on this machine."""


class StorageError(SfmFrontError):
    """A session's files cannot be read or written: disk full, damaged, locked, gone."""
