"""What a method is made of: the maps that advance a packet, and the equations that they solve."""
