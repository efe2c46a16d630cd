"""`regolithd monitor`: a process of its own that follows a recording as it grows, and reports what has begun."""
