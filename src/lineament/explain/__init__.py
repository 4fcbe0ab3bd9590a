"""What each measurement of a scan became, and why: for people who look."""

from .explain import explain

__all__ = ["explain"]
