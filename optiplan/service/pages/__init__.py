"""Pages, scripts and styles that the service sends to browsers."""
