"""What a user's own script draws into a page that is served, by meshcat's protocol."""
