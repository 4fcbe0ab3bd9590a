"""What the commands do, one call each: from a log, many logs, or a plan to files."""
