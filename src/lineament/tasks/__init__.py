"""What the commands do, one call each: a log or many into tables, a demonstration, a warm-up."""
