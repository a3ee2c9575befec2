"""Pictures and recordings of results and studies."""
