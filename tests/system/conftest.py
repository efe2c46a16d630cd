"""Fixtures of the system tests."""

from stack import stack

__all__ = ["stack"]
