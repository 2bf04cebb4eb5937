"""Design one gain for uncertain inputs, which are given as probability distributions or intervals."""

from .design import robust

__all__ = ["robust"]
