"""What runs on the server while clients watch and speak to it, each in a process of its own."""
