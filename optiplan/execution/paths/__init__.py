"""A proved path, its laws, stops and what takes over."""
