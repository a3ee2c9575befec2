"""Pictures and recordings: they read a Result and nothing else, and import their libraries when called."""
