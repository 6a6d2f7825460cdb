"""What answers each path. `lichen_service.app` puts the routes together."""
