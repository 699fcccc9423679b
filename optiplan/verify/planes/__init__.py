"""What planes between bodies prove, in the native core, and the books of the search that asks them."""
