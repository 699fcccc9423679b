"""Who solves: warm processes under hard limits, and the durable queue that feeds them."""
