"""The maps that methods are made of, each advancing a packet, and the solvers of their equations."""
