"""The events a scene may name, one file each: `distance(view, p)`, positive while all is well; p: the declared numbers."""
