"""The service: problems in over HTTP, planned by a durable queue of warm processes, answers kept, pages to look."""
