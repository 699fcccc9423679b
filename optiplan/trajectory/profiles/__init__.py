"""Time laws from rest to rest, and joints synchronised on them."""
