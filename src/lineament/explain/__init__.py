"""What each measurement of a scan became, and why: for people who look."""

from .explain import Explanation, explain

__all__ = ["Explanation", "explain"]
