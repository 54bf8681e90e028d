"""Methods that morph a surface, behind one interface: the curvature transformation, and flows to compare it with."""
