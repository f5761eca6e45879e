"""Makers of the project's data, docs and figures of quality. Run from the root of the repository; not part of the package."""
