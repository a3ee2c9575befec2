"""The one fused kernel: a packet of vehicles through all its steps, with only what the scene has."""
