from .findings import Finding
from .logs import Audit, audit

__all__ = ["Audit", "Finding", "audit"]
